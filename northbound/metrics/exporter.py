"""The metrics of several valves for Prometheus, by its own client library, served over HTTP.

A daemon that does not answer is `positioner_up 0` and none of its other metrics: nothing old is passed on as new.
"""

import math
import sys
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import version

from prometheus_client import CollectorRegistry, start_http_server
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily, Metric
from prometheus_client.registry import Collector

from config.errors import explain_failure
from northbound.metrics.scraped_valve import ScrapedValve
from northbound.metrics.valve_metrics import SPACE, Gauge, Histogram, metrics

MOST_SCRAPES = 16
"""Daemons read at the same time, so that those that do not answer hold up no scrape."""


class ValveCollector(Collector):
    """Reads the valves whenever it is asked."""

    def __init__(self, valves: Sequence[ScrapedValve]) -> None:
        self._valves = valves
        self._said: dict[str, str] = {}

    def collect(self) -> Iterable[Metric]:
        """Return what each valve's daemon says now."""
        families: dict[str, Metric] = {}
        up = GaugeMetricFamily(f"{SPACE}_up", "1 if the valve's daemon answers", labels=["valve"])
        with ThreadPoolExecutor(min(len(self._valves), MOST_SCRAPES)) as readers:
            for valve, values in zip(self._valves, readers.map(ScrapedValve.read, self._valves), strict=True):
                up.add_metric([valve.name], float(values is not None))
                self._say(valve)
                for each in () if values is None else metrics(values):
                    _enter(families, valve.name, each)
        build = GaugeMetricFamily(f"{SPACE}_build_info", "the version of this exporter", labels=["version"])
        build.add_metric([version("positioner")], 1.0)
        return [build, up, *families.values()]

    def describe(self) -> Iterator[Metric]:
        """Name nothing beforehand: a daemon need not be there when this begins."""
        return iter(())

    def _say(self, valve: ScrapedValve) -> None:
        """Say once why a daemon does not answer, and once that it does again."""
        if valve.problem != self._said.get(valve.name, ""):
            self._said[valve.name] = valve.problem
            print(f"{valve.name}: {valve.problem or 'answers'}", file=sys.stderr, flush=True)


def serve_metrics(valves: Sequence[ScrapedValve], host: str, port: int) -> int:
    """Serve `/metrics` from a thread; return the port.

    Raises:
        InputError: it cannot listen there.
    """
    registry = CollectorRegistry()
    registry.register(ValveCollector(valves))
    with explain_failure(f"{host}:{port}", "cannot listen there"):
        server, _ = start_http_server(port, host, registry)
    return int(server.server_port)


def _enter(families: dict[str, Metric], valve: str, each: Gauge | Histogram) -> None:
    """Put a metric of a valve to those of its name."""
    if isinstance(each, Histogram):
        family = families.setdefault(each.name, HistogramMetricFamily(each.name, each.text, labels=["valve"]))
        assert isinstance(family, HistogramMetricFamily)
        named = [("+Inf" if math.isinf(bound) else f"{bound:g}", count) for bound, count in each.buckets]
        family.add_metric([valve], named, each.total)
        return
    made = CounterMetricFamily if each.counts else GaugeMetricFamily
    names = [name for name, _ in each.labels]
    family = families.setdefault(each.name, made(each.name, each.text, labels=["valve", *names]))
    assert isinstance(family, CounterMetricFamily | GaugeMetricFamily)
    family.add_metric([valve, *(value for _, value in each.labels)], each.value)
