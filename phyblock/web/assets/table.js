/* The one table of a page: columns with headings above them, rows in any order, sorted by a click. */
"use strict";

const Table = (() => {
  const { DASH, number, dollars } = Words;

  /**
   * A table with a caption.
   *
   * A column is {heading, over, isText, about, cell(row)}, where a cell is {text, below, href}; one
   * with `value(row)` sorts the rows, beginning with what is `better`. `sorting` is the column that
   * it is sorted by at first. `name(row)` is the heading of a row.
   */
  function made({ caption, columns, rows, name, head = "Model", sorting = null, down = null }) {
    const isDown = down ?? sorting?.better !== "lower";
    const ordered = sorting ? sorted(rows, sorting.value, isDown) : rows;
    const sort = (column) => {
      const isAgain = column === sorting;
      const again = made({ caption, columns, rows, name, head, sorting: column, down: isAgain ? !isDown : null });
      whole.replaceWith(again);
      again.querySelectorAll("thead button")[columns.indexOf(column)].focus();
    };
    const spans = [];
    for (const { over = "" } of columns) {
      if (spans.at(-1)?.over === over) spans.at(-1).span += 1;
      else spans.push({ over, span: 1 });
    }
    const groups = spans.some(({ over }) => over) ? el("tr", {}, name ? el("td") : null, spans.map(({ over, span }) =>
      (over ? el("th", { scope: "colgroup", colspan: span, class: "over" }, over) : el("td", { colspan: span })))) : null;
    const heading = (column) => el("th", {
      scope: "col", class: column.isText ? "text" : null, title: column.about || null,
      "aria-sort": column === sorting ? (isDown ? "descending" : "ascending") : null,
    }, column.value ? el("button", { type: "button", onclick: () => sort(column) }, column.heading) : column.heading);
    const cell = (column, row) => {
      const { text, below, href } = column.cell(row);
      return el("td", { class: [column.isMain && "main", column.isText && "text"].filter(Boolean).join(" ") || null },
        href ? el("a", { href }, text) : text, below ? el("small", {}, below) : null);
    };
    const whole = scrolled(caption, el("table", {}, el("caption", { class: "unseen" }, caption),
      el("thead", {}, groups, el("tr", {}, name ? el("th", { scope: "col", class: "text" }, head) : null, columns.map(heading))),
      el("tbody", {}, ordered.map((row) => el("tr", { class: row.kind || null },
        name ? el("th", { scope: "row", class: "text name" }, name(row)) : null, columns.map((column) => cell(column, row)))))));
    return whole;
  }

  /** Rows by a value, those without one last, then by name. */
  function sorted(rows, value, isDown = true) {
    const sign = isDown ? -1 : 1;
    const isNone = (one) => one === null || one === undefined || one === "";
    return [...rows].sort((a, b) => {
      const [x, y] = [value(a), value(b)];
      if (isNone(x) || isNone(y)) return isNone(x) - isNone(y) || a.name.localeCompare(b.name);
      const by = typeof x === "number" ? x - y : String(x).localeCompare(String(y));
      return sign * by || a.name.localeCompare(b.name);
    });
  }

  /** Facts of a model's samples: value, heading, digits or dollars, and the sense in which less is better. */
  const FACTS = [
    [(fact) => fact.solved, "Solved", (n) => number(n, 0)],
    [(fact) => fact.cost_per_100_usd, "USD for 100 replies", dollars, "lower"], [(fact) => fact.prompt_tokens, "Tokens in, mean", (n) => number(n, 0), "lower"],
    [(fact) => fact.completion_tokens, "Tokens out, mean", (n) => number(n, 0), "lower"], [(fact) => fact.latency_median_s, "Seconds, median", (n) => number(n, 2), "lower"],
    [(fact) => fact.recorded, "Samples done", (n) => number(n, 0)], [(fact) => fact.recorded - fact.ok, "Not read or failed", (n) => number(n, 0), "lower"],
  ];

  /** All numbers of a track: values by setting, then what its samples took, then the run. */
  function numbers(track) {
    const { board } = Data, main = Data.mainOf(track);
    const values = board.columns.filter((column) => column.track === track.name).map((column) => ({
      ...column, over: column.setting && `Setting ${column.setting}`, isMain: column === main,
      about: `${track.title}${column.unit && `, in ${column.unit}`}`, value: (row) => row.values[column.id]?.[0] ?? null,
      cell: (row) => {
        const [value, lo, hi] = row.values[column.id] || [null, null, null];
        const href = value === null ? null : App.address("samples", { track: track.name, model: row.name, ...partOf(track, column.cell) });
        return { text: number(value), below: lo === null ? "" : `${number(lo)} to ${number(hi)}`, href };
      },
    }));
    const facts = FACTS.map(([of, heading, text, better = "higher"]) => {
      const value = (row) => (row.facts[track.name] ? of(row.facts[track.name]) : null);
      return { heading, over: "Samples and cost", better, value, cell: (row) => ({ text: text(value(row)) }) };
    }).filter(({ value }) => board.rows.some((row) => value(row) !== null));
    const columns = [...values, ...facts, ...ofRuns()];
    return made({ caption: `All numbers of ${track.title}`, columns, rows: board.rows.filter((row) => row.facts[track.name]), name: named,
      sorting: values.find(({ isMain }) => isMain) });
  }

  /** Facts of models and runs, where they are not the same for all. */
  function ofRuns() {
    const { board } = Data;
    const of = (what) => (row) => [...new Set(Object.values(row.runs).map((n) => what(board.runs[n])))].filter(Boolean).join(", ");
    return [
      ["Size (B)", (row) => row.size_b], ["Run begun", of((run) => run.date)], ["Asked how", of((run) => run.asked.join(", "))],
      ["Run", of((run) => run.id)], ["Independently re-scored", of((run) => (run.verified ? "yes" : "no"))],
    ].map(([heading, value]) => ({ heading, over: "Model and run", isText: true, better: "higher", value, cell: (row) => ({ text: value(row) || DASH }) }))
      .filter(({ value }) => new Set(board.rows.map(value)).size > 1);
  }

  /** The filter that a cell of the tables stands for: a level, a subtask or a group of them. */
  const partOf = (track, cell) => (/^\d$/.test(cell) ? { level: cell } : track.parts[cell] || track.groups[cell] ? { part: cell } : {});

  const named = (row) => [el("a", { href: App.address("model", { m: row.name }) }, row.name),
    Data.isModel(row) ? null : el("small", {}, "baseline")];

  /** A table of a run as it was written. */
  const written = ({ caption, columns, rows, notes }) => [
    made({ caption, rows, columns: columns.map(([heading, over, isText], n) => ({ heading, over, isText, cell: (row) => ({ text: row[n] }) })) }),
    notes.map((note) => el("p", { class: "muted" }, note))];

  /** The ranks that a row may have, as text. */
  function rank(row, track) {
    const [best, worst] = row.ranks[track.name] || [];
    if (!best) return DASH;
    return best === worst ? String(best) : `${best}–${worst}`;
  }

  /** The share of samples that were answered, why no more, and whether that leaves the row without a rank. */
  function lacking(row, track) {
    const fact = row.facts[track.name], isCut = fact.recorded < fact.expected;
    const counted = row.lacking[track.name] || (isCut ? `${number(fact.recorded, 0)} of ${number(fact.expected, 0)} samples` : "");
    return isCut ? `${counted}; no rank` : counted;
  }

  return { made, sorted, numbers, written, rank, lacking };
})();
