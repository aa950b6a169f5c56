"""Light and dark: colours of the page, and which of the plots'."""

from collections.abc import Callable

from nicegui import ui

from webpage.plot_colours import DARK, LIGHT, Ink

STYLE = """
body { font-family: system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif; }
.nicegui-content { padding: 0; gap: 0; align-items: stretch; }
body.body--dark { --q-primary: #3f92d0 !important; }
.q-header { background: #1b5e8a !important; align-items: center; }
.nicegui-code pre { white-space: pre-wrap; }
.panel { padding: 12px 16px 24px; gap: 12px; width: 100%; max-width: 2560px; margin: 0 auto; }
.side { flex: 1 1 300px; min-width: min(300px, 100%); max-width: 520px; gap: 8px; }
.wide { flex: 3 1 480px; min-width: min(480px, 100%); gap: 8px; }
.together { display: flex; flex-flow: row wrap; gap: 16px; width: 100%; align-items: flex-start; }
.w-full { width: 100%; }
.q-uploader { width: 100%; max-height: none; }
.q-uploader__list { min-height: 36px; padding: 4px; }
.q-uploader__subtitle { display: none; }
.number { font-variant-numeric: tabular-nums; }
.figure { font-size: 1.5rem; font-weight: 600; line-height: 1.2; }
.quiet { opacity: 0.75; font-size: 0.875rem; }
.said { margin: 0; padding-left: 1.2rem; }
.said li { margin: 2px 0; }
.steady { height: 17.5rem; overflow-y: auto; flex-wrap: nowrap; gap: 4px; width: 100%; }
.typed .q-field__control, .typed .q-field__native { height: 26px; min-height: 26px; padding: 0 6px; }
.jump { all: unset; vertical-align: top; cursor: pointer; text-align: left; }
.jump { text-decoration: underline dotted; text-underline-offset: 3px; }
.nicegui-error-popup { bottom: 5rem !important; }
.nicegui-row.items-center { align-items: center; }
.q-notification .q-btn { color: white !important; }
.blamed { background: rgba(217, 98, 43, 0.25); }
.jump:hover { text-decoration-style: solid; color: var(--q-primary); }
h2 { font-size: 1.05rem; font-weight: 600; margin: 6px 0 2px; line-height: 1.3; scroll-margin-top: 80px; }
*:focus-visible { outline: 2px solid #d9622b; outline-offset: 1px; }
.no-outline:focus-visible { box-shadow: 0 0 0 2px #d9622b !important; }
.body--dark .q-btn.text-negative { color: #ff8a80 !important; }
.body--dark .q-uploader__header { background: #1b5e8a; }
@media (max-width: 599px) {
  .side.before-plots { order: -1; } .plots { order: 1; } .after-plots { order: 2; }
  .compared { display: contents; } .compared > * { flex: none; width: 100%; max-width: none; }
  .steady { height: auto; max-height: 17.5rem; }
  .panel { padding: 8px 8px 24px; } .q-header { padding: 4px 8px; gap: 4px; }
  .candidates thead { display: none; }
  .candidates tr { display: flex; flex-flow: row wrap; align-items: center; border-top: 1px solid #80808066; }
  .candidates .q-table tbody tr { height: auto; }
  .candidates .q-table tbody td::before { position: static; background: none; opacity: 0.75; }
  .candidates .q-table tbody td { height: auto; border: none; padding: 2px 8px; }
  .candidates tbody td:first-child, .candidates tbody td:last-child { flex: 1 0 100%; }
  .candidates tbody td:nth-child(2)::before { content: "fitted, mm: "; }
  .candidates tbody td:nth-child(3)::before { content: "held out, mm: "; }
  .candidates tbody td:nth-child(4)::before { content: "evidence: "; }
}
"""
HIDDEN_PLOTS = """
<script>
addEventListener("unhandledrejection", (event) => {
  const said = String(event.reason?.message ?? event.reason);
  if (said.startsWith("Resize must be passed a displayed plot")) event.preventDefault();
});
</script>
"""
"""A plot that is hidden or taken away is told its new size all the same, and complains; it needs none."""
# `ui.dark_mode` would do the same, but anew at each update of anything, and each time all styles are worked out anew.
DARK_QUERY = 'matchMedia("(prefers-color-scheme: dark)").matches'


class Theme:
    """Light or dark, for one tab; tells those who draw when it changes."""

    def __init__(self) -> None:
        ui.add_css(STYLE)
        ui.add_head_html(HIDDEN_PLOTS)
        ui.colors(primary="#1b5e8a", dark_page="#12161b", dark="#1a2027")
        self._listeners: list[Callable[[], None]] = []
        self.is_dark = False

    @property
    def ink(self) -> Ink:
        """Colours of plots."""
        return DARK if self.is_dark else LIGHT

    def listen(self, redraw: Callable[[], None]) -> None:
        """Have it called when the colours change."""
        self._listeners.append(redraw)

    def forget(self) -> None:
        """Call nobody any more: what drew is gone."""
        self._listeners.clear()

    def choose(self, dark: bool) -> None:
        """Make it dark or light."""
        self.is_dark = dark
        ui.run_javascript(f"setDark({str(dark).lower()})")
        for each in self._listeners:
            each()

    async def as_the_browser_prefers(self) -> None:
        """Take what the person has told the browser; the tab must be connected."""
        self.choose(bool(await ui.run_javascript(DARK_QUERY, timeout=10.0)))

    def switch(self) -> ui.button:
        """Return a button that turns light into dark and back."""
        button = ui.button(icon="contrast", on_click=lambda: self.choose(not self.is_dark)).props("flat round dense")
        return button.props('aria-label="light or dark" color=white').tooltip("light or dark")
