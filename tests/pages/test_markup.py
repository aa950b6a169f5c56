"""Names and cells of files stay text in the pages: what is given to one as markup is listed here, with the reason."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = ("webpage", "northbound/operator_page", "workbench/page")
MAY_BE = {
    ("northbound/operator_page/valve_panel.py", "line.label"): "labels of the program's own table",
    ("northbound/operator_page/valve_panel.py", "''"): "nothing",
    ("northbound/operator_page/overview.py", "line"): "labels of the program's own list",
    ("webpage/messages.py", "f'<ul class=\"said\">{lines}</ul>'"): "each line is escaped before",
    ("webpage/messages.py", "f'<h2{place}>{escape(text)}</h2>'"): "escaped; the place is the program's own",
}


def test_nothing_is_given_as_markup_but_what_is_known_to_be_harmless() -> None:
    found = set()
    for path in (each for room in PAGES for each in (ROOT / room).glob("*.py")):
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(call, ast.Call) and any(each.arg == "sanitize" for each in call.keywords):
                found.add((str(path.relative_to(ROOT)), ast.unparse(call.args[0])))
    assert found == MAY_BE.keys()
