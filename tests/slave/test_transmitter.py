"""The position transmitter: the noise it says, white, repeatable; the quantum it says."""

import numpy as np

from config.slave_file import Sensor
from sim.transmitter import Transmitter

N = 20_000
SIGMA_M = 1e-4


def noise_m(seed: int) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    transmitter = Transmitter(Sensor(noise_std_m=SIGMA_M, seed=seed))
    return np.array([transmitter.measure(0.05) for _ in range(N)]) - 0.05


def test_noise_has_its_standard_deviation_and_no_colour() -> None:
    noise = noise_m(1) / SIGMA_M
    five_sigma = 5 / np.sqrt(N)
    assert abs(noise.mean()) < five_sigma
    assert abs(noise.std() - 1) < five_sigma
    correlation = [float(noise[lag:] @ noise[:-lag]) / N for lag in (1, 2, 3, 10, 4096)]
    assert max(map(abs, correlation)) < five_sigma


def test_the_same_seed_gives_the_same_noise_and_another_another() -> None:
    assert np.array_equal(noise_m(1), noise_m(1))
    assert not np.array_equal(noise_m(1), noise_m(2))


def test_a_quantum_rounds_to_its_multiples_and_zero_rounds_nothing() -> None:
    coarse = Transmitter(Sensor(quantum_m=1e-4))
    assert [round(coarse.measure(x) / 1e-4, 9) for x in (0.00004, 0.00006, 0.01234, -0.00026)] == [0, 1, 123, -3]
    assert Transmitter(Sensor()).measure(0.0123456789) == 0.0123456789


def test_noise_is_added_before_rounding() -> None:
    noisy = Transmitter(Sensor(noise_std_m=1e-4, quantum_m=1e-4))
    assert len({round(noisy.measure(0.0) / 1e-4) for _ in range(100)}) > 3
