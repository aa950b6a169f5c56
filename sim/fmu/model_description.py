"""What an FMU says of itself: `modelDescription.xml` of FMI 2.0.4, and the same numbers for its C text.

Value references: 0 the input, held over a step; 1 to 4 the outputs; 5 and 6 where it starts; then the parameters, in
the order of the composition's `names`. A unit stands at the end of a name, as everywhere here.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import inf
from xml.etree import ElementTree

from sim.composition import BASE, Composition

FMI_VERSION = "2.0"
IDENTIFIER = "valve"
FMU_STEP_S = 1e-3
UNITS = {
    "_ns_per_m": ("N.s/m", {"kg": 1, "s": -1}),
    "_n_per_m": ("N/m", {"kg": 1, "s": -2}),
    "_m_per_s": ("m/s", {"m": 1, "s": -1}),
    "_kg": ("kg", {"kg": 1}),
    "_m2": ("m2", {"m": 2}),
    "_pa": ("Pa", {"kg": 1, "m": -1, "s": -2}),
    "_n": ("N", {"kg": 1, "m": 1, "s": -2}),
    "_m": ("m", {"m": 1}),
    "_s": ("s", {"s": 1}),
}
"""The unit of a name by its end, the longest first, and its exponents of the base units."""
ABOVE_ZERO = ("mass_kg", "diaphragm_area_m2", "stribeck_velocity_m_per_s", "deadzone_ratio")
"""Parameters of the bare valve that must not be 0 either (`config.valve_file`)."""


@dataclass(frozen=True, slots=True)
class Variable:
    """A variable of the unit; least and most are the ends of its range."""

    name: str
    text: str
    causality: str
    start: float | None = None
    least: float = -inf
    most: float = inf


def variables(composition: Composition) -> list[Variable]:
    """Return the variables, each at the place of its value reference."""
    enters = (
        Variable("reference_m", "set point of the positioner, held over a step", "input", 0.0)
        if composition.by_setpoint
        else Variable("command_pa", "pressure commanded, held over a step", "input", 0.0)
    )
    return [
        enters,
        Variable("position_m", "position as the sensor indicates it, without noise", "output"),
        Variable("stem_position_m", "true stem position", "output"),
        Variable("stem_velocity_m_per_s", "true stem velocity", "output"),
        Variable("pressure_pa", "pressure in the actuator, behind the pressure path", "output"),
        Variable("initial_position_m", "where the stem rests at the start", "parameter", 0.0),
        Variable("initial_command_pa", "the command that has long been held then", "parameter", 0.0),
        *_parameters(composition),
    ]


def _parameters(composition: Composition) -> Iterator[Variable]:
    start = dict(zip(composition.names, composition.theta.tolist(), strict=True))
    for name in BASE:
        yield Variable(name, "of the bare valve", "parameter", start[name], 0.0)
    for effect in composition.effects:
        for key, said in effect.parameters.items():
            name = f"{effect.name}.{key}"
            yield Variable(name, said.text, "parameter", start[name], said.least, said.most)


def model_description(composition: Composition, guid: str, tool: str) -> bytes:
    """Return the text of `modelDescription.xml`."""
    root = ElementTree.Element(
        "fmiModelDescription",
        fmiVersion=FMI_VERSION,
        modelName=composition.valve.name,
        guid=guid,
        generationTool=tool,
        variableNamingConvention="structured",
        numberOfEventIndicators="0",
    )
    ElementTree.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=IDENTIFIER,
        canHandleVariableCommunicationStepSize="true",
        canGetAndSetFMUstate="true",
    )
    all_of_it = variables(composition)
    _units(root, all_of_it)
    ElementTree.SubElement(root, "DefaultExperiment", startTime="0", stopTime="10", stepSize=repr(FMU_STEP_S))
    listed = ElementTree.SubElement(root, "ModelVariables")
    for reference, each in enumerate(all_of_it):
        _variable(listed, reference, each)
    structure = ElementTree.SubElement(root, "ModelStructure")
    for group in ("Outputs", "InitialUnknowns"):
        unknown = ElementTree.SubElement(structure, group)
        for place, each in enumerate(all_of_it, start=1):
            if each.causality == "output":
                ElementTree.SubElement(unknown, "Unknown", index=str(place))
    ElementTree.indent(root)
    return bytes(ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True))


def unit_of(name: str) -> str | None:
    """Return the unit at the end of a name; None of a ratio."""
    return next((unit for end, (unit, _) in UNITS.items() if name.endswith(end)), None)


def _units(root: ElementTree.Element, all_of_it: list[Variable]) -> None:
    used = {unit_of(each.name) for each in all_of_it}
    definitions = ElementTree.SubElement(root, "UnitDefinitions")
    for name, exponents in UNITS.values():
        if name in used:
            unit = ElementTree.SubElement(definitions, "Unit", name=name)
            ElementTree.SubElement(unit, "BaseUnit", {base: str(exponent) for base, exponent in exponents.items()})


def _variable(listed: ElementTree.Element, reference: int, each: Variable) -> None:
    kind = {"input": ("continuous", None), "output": ("continuous", "calculated"), "parameter": ("tunable", "exact")}
    variability, initial = kind[each.causality]
    if each.name.startswith("initial_"):
        variability = "fixed"
    said = {
        "name": each.name,
        "valueReference": str(reference),
        "description": each.text,
        "causality": each.causality,
        "variability": variability,
    }
    scalar = ElementTree.SubElement(listed, "ScalarVariable", said | ({"initial": initial} if initial else {}))
    numbers = {"start": each.start, "min": _finite(each.least), "max": _finite(each.most)}
    unit = unit_of(each.name)
    real = ({"unit": unit} if unit else {}) | {key: repr(value) for key, value in numbers.items() if value is not None}
    ElementTree.SubElement(scalar, "Real", real)


def _finite(value: float) -> float | None:
    return None if value in (inf, -inf) else value
