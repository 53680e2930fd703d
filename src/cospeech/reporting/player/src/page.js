// The page's elements. Text from the data only ever enters as textContent.

export function element(tag, properties = {}, ...children) {
  const node = document.createElement(tag);
  const { dataset, ...rest } = properties;
  Object.assign(node, rest);
  Object.assign(node.dataset, dataset);
  node.append(...children);
  return node;
}

const ICONS = {
  play: "M8 5v14l11-7z",
  pause: "M7 5h4v14H7zM13 5h4v14h-4z",
  loop: "M7 7h10v3l4-4-4-4v3H5v6h2zm10 10H7v-3l-4 4 4 4v-3h12v-6h-2z",
};

export function icon(name) {
  const namespace = "http://www.w3.org/2000/svg";
  const svg = document.createElementNS(namespace, "svg");
  svg.setAttribute("viewBox", "0 0 24 24");
  const path = document.createElementNS(namespace, "path");
  path.setAttribute("d", ICONS[name]);
  svg.append(path);
  return svg;
}

/** Build the page; returns its parts by name. */
export function buildPage({ title, notes, clips }) {
  const ui = {
    clip: element("select", { id: "clip", title: "Clip (PageUp, PageDown)" },
      ...clips.map((clip, i) => element("option", { value: String(i), textContent: clip.name }))),
    theme: element("button", { id: "theme", type: "button", title: "Dark or light (D)", textContent: "\u25d0" }),
    stage: element("div", { id: "stage" }),
    labels: element("div", { id: "labels" }),
    play: element("button", { id: "play", type: "button", title: "Play or pause (space)" }),
    scrub: element("input", { id: "scrub", type: "range", min: "0", step: "any", value: "0", ariaLabel: "Time" }),
    time: element("output", { id: "time" }),
    rate: element("select", { id: "rate", title: "Speed" },
      ...[0.1, 0.25, 0.5, 0.75, 1, 1.5, 2].map((rate) =>
        element("option", { value: String(rate), textContent: `${rate}\u00d7`, selected: rate === 1 }))),
    loop: element("button", { id: "loop", type: "button", title: "Loop (L)" }, icon("loop")),
    blend: element("button", { id: "blend", type: "button", title: "Blend between frames (I); off shows each frame as it is", textContent: "Smooth" }),
    trails: element("button", { id: "trails", type: "button", title: "Wrist trails, last half second (T)", textContent: "Trails" }),
    words: element("p", { id: "words" }),
    timeline: element("canvas", { id: "timeline" }),
    legend: element("div", { id: "legend" }),
    facts: element("table", { id: "facts" }),
    message: element("p", { id: "message", hidden: true, role: "alert" }),
  };
  ui.play.append(icon("play"));
  ui.clip.hidden = clips.length < 2;
  ui.stage.append(ui.labels);
  document.body.append(
    element("header", {},
      element("div", {}, element("h1", { textContent: title }),
        element("p", { className: "notes", textContent: notes, hidden: !notes })),
      ui.clip, ui.theme),
    ui.message,
    ui.stage,
    element("div", { id: "transport" }, ui.play, ui.scrub, ui.time, ui.rate, ui.loop, ui.blend, ui.trails),
    ui.words,
    ui.timeline,
    element("footer", {}, ui.legend, ui.facts,
      element("p", { className: "keys", textContent:
        "space play \u00b7 \u2190 \u2192 one frame (shift: one second) \u00b7 drag to orbit, wheel to zoom, shift-drag to move, double click to reset \u00b7 wheel over the time line to zoom in time" })),
  );
  return ui;
}

export function fillFacts(table, facts) {
  table.replaceChildren(...facts.map(([key, value]) =>
    element("tr", {}, element("th", { textContent: key }), element("td", { textContent: value }))));
}

export function fillLegend(legend, tracks, partColours, phaseColours) {
  const swatch = (colour, text) => {
    const mark = element("i");
    mark.style.background = colour;
    return element("span", {}, mark, text);
  };
  const labels = new Set(tracks.flatMap((track) => (track.phases ?? []).map(([, , label]) => label)));
  labels.delete("none");
  legend.replaceChildren(
    swatch(partColours[1], "left arm"),
    swatch(partColours[2], "right arm"),
    ...Object.keys(phaseColours).filter((label) => labels.has(label))
      .map((label) => swatch(phaseColours[label], label.replaceAll("_", " "))),
  );
}

/** The running transcript; a click on a word jumps to its start. */
export function fillWords(paragraph, words, seek) {
  const spans = (words ?? []).map(([text, start]) => {
    const span = element("span", { textContent: text });
    span.addEventListener("click", () => seek(start));
    return span;
  });
  paragraph.replaceChildren(...spans.flatMap((span) => [span, " "]));
  paragraph.hidden = !spans.length;
  return spans;
}
