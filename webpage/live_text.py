"""A text that changes many times a second.

What changes of a label has the browser go through the whole page; this text is changed by itself.
"""

from nicegui.element import Element


class LiveText(Element, component="live_text.js"):
    """Shows a text."""

    def __init__(self) -> None:
        super().__init__()
        self._text = ""

    def show(self, text: str) -> None:
        """Show another text; a page that is built meanwhile begins with it."""
        if text == self._text:
            return
        self._text = text
        with self.props.suspend_updates():
            self.props["value"] = text
        self.run_method("show", text)
