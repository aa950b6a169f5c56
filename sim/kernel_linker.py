"""A kernel's bitcode, of that of the laws and of its effects: no text is compiled any more, hence numba not needed.

What fills a place calls the effects' functions one after the other, each with where its parameters and its memory
begin; all is then inlined wherever a law calls it. The functions are of numba's convention (`sim.machine_code`).
"""

from collections.abc import Collection, Mapping, Sequence
from typing import Any, get_type_hints

from llvmlite import binding, ir

from sim.karnopp import Stem
from sim.kernel_source import PLACES, Filling
from sim.machine_code import features, target_machine

SYMBOL = "place_{}"
NUMBER, ADDRESS, WORD = ir.DoubleType(), ir.PointerType(), ir.IntType(64)
STATUS = ir.IntType(32)
ARGUMENTS: Mapping[Any, tuple[ir.Type, ...]] = {float: (NUMBER,), Stem: (NUMBER,) * len(Stem._fields), Any: (ADDRESS,)}
HANDED_ON: Mapping[Any, int] = {type(None): 0, float: 1, tuple[float, float]: 2}
"""How many of its arguments, the first ones, a place hands on."""


def linked(
    laws: bytes, effects: Sequence[bytes], filled: Mapping[str, Sequence[Filling]], entries: Collection[str]
) -> bytes:
    """Fill the places of compiled laws by compiled effects."""
    whole = binding.parse_bitcode(laws)
    called = {each.name for each in whole.functions}
    places = {name: each for name, each in filled.items() if SYMBOL.format(name) in called}
    for i, bitcode in enumerate(effects):
        effect = binding.parse_bitcode(bitcode)
        for each in effect.functions:
            if not each.is_declaration:
                each.name = _symbol(each.name, i)
        whole.link_in(effect)
    whole.link_in(binding.parse_assembly(str(_filling(places))))
    return optimized(whole, entries)


def optimized(whole: Any, kept: Collection[str]) -> bytes:
    """Inline what is called in a module, and optimize what comes of it; all but the functions kept is its own."""
    for each in whole.functions:
        if each.name in kept or each.is_declaration:
            continue
        each.linkage = "internal"
        if each.name.startswith(SYMBOL.format("")):
            each.add_function_attribute("alwaysinline")
    options = binding.create_pipeline_tuning_options(speed_level=3)
    builder = binding.create_pass_builder(target_machine(*features()), options)
    builder.getModulePassManager().run(whole, builder)
    return bytes(whole.as_bitcode())


def _symbol(name: str, effect: int) -> str:
    return f"{name}_{effect}"


def _filling(places: Mapping[str, Sequence[Filling]]) -> ir.Module:
    """Return the functions that fill the places."""
    module = ir.Module()
    module.triple = binding.get_process_triple()
    for name, filled in places.items():
        hints = get_type_hints(PLACES[name])
        handed_on = HANDED_ON[hints.pop("return")]
        given = [each for kind in hints.values() for each in ARGUMENTS[kind]]
        of = ir.FunctionType(STATUS, (ADDRESS, ADDRESS, *given))
        parts = [(ir.Function(module, of, _symbol(SYMBOL.format(name), each.effect)), each) for each in filled]
        _one_after_the_other(ir.Function(module, of, SYMBOL.format(name)), parts, handed_on)
    return module


def _one_after_the_other(place: ir.Function, parts: Sequence[tuple[ir.Function, Filling]], handed_on: int) -> None:
    """Write a place: what its parts hand on, or the status of the first that fails."""
    result, error, *values, q, z = place.args
    for each in (result, error, q, z):
        each.add_attribute("noalias")
    builder = ir.IRBuilder(place.append_basic_block())
    for part, at in parts:
        own = [
            builder.gep(array, [WORD(first)], source_etype=NUMBER)
            for array, first in ((q, at.parameters), (z, at.memory))
        ]
        status = builder.call(part, [result, error, *values, *own])
        with builder.if_then(builder.icmp_signed("!=", status, STATUS(0)), likely=False):
            builder.ret(status)
        values[:handed_on] = [builder.load(_entry(builder, result, i), typ=NUMBER) for i in range(handed_on)]
    for i in range(handed_on):
        builder.store(values[i], _entry(builder, result, i))
    builder.ret(STATUS(0))


def _entry(builder: ir.IRBuilder, result: Any, i: int) -> Any:
    return builder.gep(result, [WORD(i)], source_etype=NUMBER)
