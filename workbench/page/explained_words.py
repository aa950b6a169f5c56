"""Words that explain themselves where they stand: pressed, or pointed at, a word shows what it means.

The texts are those of the report; an effect's is its file's.
"""

from nicegui import ui

from sim.effect import find_effect
from workbench.report.comparison_report import WORDS as COMPARISON
from workbench.report.diagnosis_report import DIAGNOSIS_WORDS

WORDS = {name.lower(): text for name, text in (COMPARISON | DIAGNOSIS_WORDS).items()} | {
    "held out": DIAGNOSIS_WORDS["Fitted, held out"],
    "fitted": DIAGNOSIS_WORDS["Fitted, held out"],
    "slips": f"{COMPARISON['Slip']} Matched: model and stem slip at about the same time. Missed: only the "
    "stem slips. Spurious: only the model slips.",
    "preview": "How much of the error a weak effect of each kind would explain, before any was fitted. It names the "
    "right effect in about two of three cases, and is no verdict.",
    "step": "Each step tries every effect beside those found before.",
}
SHOWS = 'class="text-body2 q-pa-sm" style="max-width: 320px; white-space: normal"'
EFFECT_CELL = f"""<q-td :props="props"><span class="jump" tabindex="0">{{{{ props.row.effect }}}}
    <q-menu><div {SHOWS}>{{{{ props.row.about }}}}</div></q-menu></span></q-td>"""
"""A cell with an effect's name, pressed for what it is."""
ADDING_CELL = f"""<q-td :props="props"><q-btn flat dense no-caps icon="add" color="primary" :label="props.value"
    :aria-label="`add ${{props.value}}`" @click="() => $parent.$emit('add', props.row)" />
    <q-btn flat dense round size="sm" icon="help_outline" :aria-label="`what ${{props.value}} is`">
    <q-menu><div {SHOWS}>{{{{ props.row.about }}}}</div></q-menu></q-btn></q-td>"""
"""The same with a button that adds it: a button, so that a keyboard reaches it."""


def word(text: str, key: str = "") -> None:
    """Show a word that explains itself; `key`: of `WORDS`, the word itself where nothing is said."""
    explain_text(text, WORDS[key or text])


def explain_text(text: str, meaning: str) -> None:
    """Show a text whose meaning shows when it is pressed."""
    button = ui.element("button").classes("jump quiet").props(f'type="button" aria-label="what {text} means"')
    with button, ui.element("span"):
        ui.label(text).style("display: inline")
        with ui.menu(), ui.element("div").classes("q-pa-sm").style("max-width: 320px"):
            ui.label(meaning).classes("text-body2")


def about_effect(name: str) -> str:
    """Return what an effect is, and what it looks like in a record."""
    effect = find_effect(name, "effects")
    return effect.text + (f" In a record: {effect.looks}" if effect.looks else "")
