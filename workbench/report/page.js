"use strict";
// A plot is drawn when it is first seen: in closed details it has no width.
const settings = {
  responsive: true, displaylogo: false, topojsonURL: "", plotlyServerURL: "",
  modeBarButtonsToRemove: ["lasso2d", "select2d", "autoScale2d"],
};
const isNarrow = () => window.matchMedia("(max-width: 600px)").matches;

function draw(place) {
  if (place.dataset.drawn) return;
  place.dataset.drawn = "yes";
  const figure = JSON.parse(document.getElementById(place.id + "-data").textContent);
  if (isNarrow()) {
    // A finger scrolls the page; the buttons zoom.
    figure.layout.dragmode = false;
    figure.layout.font.size = 11;
    figure.layout.margin = { ...figure.layout.margin, l: 48, r: 10 };
    figure.layout.legend = { ...figure.layout.legend, yref: "container", y: 0, yanchor: "bottom" };
  }
  Plotly.newPlot(place, figure.data, figure.layout, settings);
}

function drawOpen() {
  for (const place of document.querySelectorAll(".plot"))
    if (!place.closest("details:not([open])")) draw(place);
}

for (const each of document.querySelectorAll("details")) each.addEventListener("toggle", drawOpen);
window.addEventListener("beforeprint", () => {
  for (const each of document.querySelectorAll("details")) each.open = true;
  drawOpen();
  for (const place of document.querySelectorAll(".plot")) Plotly.relayout(place, { width: 640 });
});
window.addEventListener("afterprint", () => {
  for (const place of document.querySelectorAll(".plot")) Plotly.relayout(place, { width: null, autosize: true });
});
drawOpen();
