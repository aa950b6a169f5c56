"""The pictures of the operator's page in both themes, made anew: `python -m docs.operator_picture [FILE.png]`.

A simulated valve is identified and moved; then Chromium is asked for what it shows.
"""

import sys
import tempfile
import time
from pathlib import Path

from config.codes import Mode
from positioner.dcs import Dcs
from tests.pages.browser import opened, served
from tests.pages.valve_site import valve_site

PICTURE = Path(__file__).parent / "img" / "operator-page.png"
REFERENCES = (0.6, 0.35, 0.5, 0.7, 0.55, 0.4)
HELD_S = 6.0
ALL_OF_NOW = ".panel { animation: none !important; }"
"""The browser greys what it hears nothing about, as while it draws a picture of the whole page."""


def make(picture: Path) -> None:
    """Make them."""
    with tempfile.TemporaryDirectory() as name, valve_site(Path(name)) as site:
        words = ("page", "--config", str(site.config))
        with (
            served(*words) as address,
            opened(address) as page,
            Dcs("127.0.0.1", site.port) as dcs,
        ):
            page.get_by_test_id("trend").wait_for()
            dcs.set("mode", Mode.AUTOMATIC)
            dcs.set("reference", 0.45)
            time.sleep(HELD_S)
            dcs.identify({}, 60.0)
            for reference in REFERENCES:
                dcs.set("reference", reference)
                time.sleep(HELD_S)
            page.get_by_test_id("work-out").click()
            page.get_by_test_id("moves").get_by_text("step").first.wait_for()
            page.add_style_tag(content=ALL_OF_NOW)
            time.sleep(HELD_S)  # what working them out held up is over
            page.screenshot(path=picture, full_page=True)
            page.get_by_label("light or dark").click()
            page.mouse.move(400, 300)  # off the button, whose tooltip would be in the picture
            time.sleep(1.0)  # for the charts to be drawn in their new colours
            page.screenshot(path=picture.with_stem(f"{picture.stem}-dark"), full_page=True)


if __name__ == "__main__":
    make(Path(sys.argv[1]) if sys.argv[1:] else PICTURE)
