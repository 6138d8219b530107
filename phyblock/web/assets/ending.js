/* How a session went, shown after its end alone. */
"use strict";

const Results = (() => {
  const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;
  const number = (value) => (value === null || value === undefined ? "–" : Words.fixed(value));

  function page(results, finish) {
    return el("div", { class: "results" },
      el("h1", {}, "How it went"),
      results.notes.map((note) => el("p", { class: "note" }, note)),
      results.tracks.filter((track) => track.rows.length).map(part),
      el("p", {}, el("a", { href: "report.html", target: "_blank" }, "The whole report, with replays"),
        " (opens beside this page)"),
      el("button", { type: "button", class: "primary", onclick: (event) => {
        event.target.disabled = true;
        event.target.textContent = "You can close this page";
        finish();
      } }, "Finish"));
  }

  function part(track) {
    const rivals = new Map();
    for (const row of track.rows) {
      for (const other of row.others) rivals.set(other.name, [...(rivals.get(other.name) || []), other.value]);
    }
    const own = track.rows.map((row) => row.value).filter((value) => value !== null && value !== undefined);
    const lines = [["You", own], ...rivals].filter(([, values]) => values.length)
      .sort((a, b) => (mean(b[1]) - mean(a[1])) * (track.better === "higher" ? 1 : -1));
    return el("section", {},
      el("h2", {}, track.title),
      el("p", { class: "muted" }, `${track.measure}, mean over ${Words.count(track.rows.length, track.item)}${track.unit && ` [${track.unit}]`}`),
      el("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": `${track.title}: means` },
        el("table", {},
          el("tbody", {}, lines.map(([name, values]) => el("tr", { class: name === "You" ? "own" : null },
            el("th", { scope: "row", class: "text" }, name),
            el("td", { class: "number" }, number(mean(values))),
            el("td", { class: "muted number" }, `n = ${values.length}`)))))),
      el("ol", { class: "went" }, track.rows.map((row) => one(row, track))));
  }

  function one(row, track) {
    const others = row.others.map((other) => `${other.name} ${number(other.value)}`).join(", ");
    return el("li", { class: "card" },
      el("h3", {}, `${row.key}: `, el("span", { class: "number" }, `${number(row.value)} ${track.unit}`)),
      answer(row),
      el("p", { class: "muted" },
        row.took_s === null ? null : `You took ${Math.round(row.took_s)} s. `,
        others ? `Others: ${others}. ` : null,
        el("a", { href: `report.html#samples?s=${encodeURIComponent(row.sample)}`, target: "_blank",
          "aria-label": `Replay ${row.key}` }, "Replay")));
  }

  function answer(row) {
    if (row.right !== undefined) {
      const words = row.correct ? `You answered ${row.given}, which is right.`
        : `You answered ${row.given || "nothing"}; ${row.right} is right.`;
      return el("p", {}, words);
    }
    if (!row.steps) return null;
    const first = row.steps.findIndex((step) => step.why);
    const parts = [];
    if (first >= 0) parts.push(`It first broke at step ${first + 1}: ${Words.reason(row.steps[first].why)}.`);
    if (row.missing) parts.push(`${Words.count(row.missing, "block")} of the goal ${row.missing === 1 ? "is" : "are"} missing.`);
    if (!parts.length) parts.push("Every step is right, and nothing is missing.");
    return [
      el("ol", { class: "chips" }, row.steps.map((step, n) => el("li", { class: step.why ? "wrong" : "right" },
        el("span", { class: "muted number" }, `${n + 1}.`), el("b", { class: "number" }, step.name),
        step.why ? ` ✗ ${Words.reason(step.why)}` : " ✓"))),
      el("p", {}, parts.join(" ")),
    ];
  }

  return { page };
})();
