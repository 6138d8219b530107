/* The ranked table: which columns it has, in which order its rows stand, and how a cell reads. */
"use strict";

const Table = (() => {
  const DASH = "–";
  const FACTS = [
    ["solved", "Solved", (fact, track) => [fact.solved, `of ${fact.done.toLocaleString("en")}`, track]],
    ["usd_per_solved", "USD a solved {item}", (fact) => [fact.usd_per_solved, "", null, "usd"]],
    ["usd_per_100", "USD for 100 replies", (fact) => [fact.usd_per_100, "", null, "usd"]],
    ["prompt_tokens", "Tokens in", (fact) => [fact.prompt_tokens]],
    ["completion_tokens", "Tokens out", (fact) => [fact.completion_tokens]],
    ["latency_s", "Seconds", (fact) => [fact.latency_s, "", null, "s"]],
    ["done", "Samples done", (fact) => [fact.done, fact.done < fact.expected ? `of ${fact.expected.toLocaleString("en")}` : ""]],
    ["failed", "Not read or failed", (fact) => [fact.failed]],
  ];
  /** What no scoring can tell. */
  const RECORDED = ["usd_per_solved", "usd_per_100", "prompt_tokens", "completion_tokens", "latency_s"];
  /** What there is only where a sample can be worth all that there is. */
  const OF_SOLVED = ["solved", "usd_per_solved"];
  const LOWER_FIRST = [...RECORDED, "failed", "rank"];

  const text = (value, digits = 1) => (value === null || value === undefined ? DASH
    : Number(Words.fixed(value, digits)).toLocaleString("en", { minimumFractionDigits: digits, maximumFractionDigits: digits }));
  const dollars = (value) => (value === null || value === undefined ? DASH
    : value === 0 ? "0" : value >= 1 ? text(value, 2) : value.toPrecision(2));

  /** A value column: what stands in a row, and how it is sorted. */
  function valueColumn(column, track) {
    const share = column.unit ? `${column.unit === "%" ? "%" : column.unit}` : "";
    return {
      id: column.id, heading: column.heading, part: column.cell, 
      about: [track.title, column.setting && `setting ${column.setting}`, share && `in ${share}`].filter(Boolean).join(", "),
      isMain: column.heading === track.main, better: column.better,
      value: (row) => (row.values[column.id] ? row.values[column.id][0] : null),
      cell: (row) => {
        const found = row.values[column.id];
        if (!found) return { text: DASH };
        const [value, lo, hi] = found;
        return { text: text(value), below: lo === null ? "" : `${text(lo)} to ${text(hi)}` };
      },
    };
  }

  function factColumn([name, heading, of], track) {
    return {
      id: `${track.name}/${name}`, heading: heading.replace("{item}", track.item), about: track.title + (RECORDED.includes(name) ? ", as the records say" : ""), better: LOWER_FIRST.includes(name) ? "lower" : "higher",
      value: (row) => (row.facts[track.name] ? of(row.facts[track.name])[0] ?? null : null),
      cell: (row) => {
        if (!row.facts[track.name]) return { text: DASH };
        const [value, below = "", , form] = of(row.facts[track.name]);
        const shown = form === "usd" ? dollars(value) : text(value, form === "s" ? 2 : 0);
        return { text: shown, below };
      },
    };
  }

  function rowColumns(board) {
    const plain = (id, heading, value, shown = value, about = "") => ({
      id, heading, about, better: "higher", value,
      cell: (row) => ({ text: shown(row) || DASH, isText: true }) });
    const of = (row, what) => [...new Set(Object.values(row.runs).map((n) => what(board.runs[n])).filter(Boolean))].join(", ");
    return [
      plain("size", "Size (B)", (row) => row.size_b, (row) => (row.size_b === null ? DASH : String(row.size_b))),
      plain("date", "Run begun", (row) => of(row, (run) => run.date), (row) => of(row, (run) => run.date),
        "The day on which the run was begun, UTC: recorded replies were scored then"),
      plain("seeds", "Seeds", (row) => board.runs[Object.values(row.runs)[0]].seeds, (row) => of(row, (run) => String(run.seeds))),
      plain("asked", "Asked how", (row) => of(row, (run) => run.asked.join(", ")), (row) => of(row, (run) => run.asked.join(", ")) || DASH),
      plain("run", "Run", (row) => of(row, (run) => run.id), (row) => of(row, (run) => run.id)),
      plain("verified", "Independently re-scored", (row) => of(row, (run) => (run.verified ? "yes" : "no")),
        (row) => of(row, (run) => (run.verified ? "yes" : "no"))),
    ];
  }

  const factsOf = (track) => FACTS.filter(([name]) => track.best !== null || !OF_SOLVED.includes(name));

  /** Every column of a track, its main one first, then what its samples took, then the run. */
  function columns(board, track) {
    const mine = board.columns.filter((column) => column.track === track.name);
    const settings = [...new Set(mine.map((column) => column.setting))];
    const values = settings.flatMap((setting) => mine.filter((column) => column.setting === setting)
      .sort((a, b) => (b.heading === track.main) - (a.heading === track.main))
      .map((column) => ({ ...valueColumn(column, track), over: setting && `Setting ${setting}` })));
    const facts = factsOf(track).map((fact) => ({ ...factColumn(fact, track), over: "Samples and cost" }))
      .filter((column) => board.rows.some((row) => column.value(row) !== null));
    return [...values, ...facts, ...rowColumns(board).map((column) => ({ ...column, over: "Model and run" }))];
  }

  /** Rows by a column, those without a value last, then by name. */
  function sorted(rows, column, descending) {
    const sign = descending ? -1 : 1;
    return [...rows].sort((a, b) => {
      const [x, y] = [column.value(a), column.value(b)];
      const none = [x, y].map((value) => value === null || value === undefined || value === "");
      if (none[0] || none[1]) return none[0] - none[1] || a.name.localeCompare(b.name);
      const by = typeof x === "number" ? x - y : String(x).localeCompare(String(y));
      return sign * by || a.name.localeCompare(b.name);
    });
  }

  /** The ranks that a row may have, as text. */
  function rank(row, track) {
    const range = row.ranks[track];
    if (!range) return DASH;
    return range[0] === range[1] ? String(range[0]) : `${range[0]}–${range[1]}`;
  }

  /** How many samples of how many were answered and why no more, where some were not; and whether
      that leaves the row without a rank. */
  function lacking(row, track) {
    const [fact, why] = [row.facts[track], row.lacking[track]];
    const said = (number) => number.toLocaleString("en");
    const counted = why || (isCut(row, track) ? `${said(fact.done)} of ${said(fact.expected)} samples` : "");
    return counted && isCut(row, track) ? `${counted}; no rank` : counted;
  }

  /** Whether a row was not asked everything that its run holds. */
  function isCut(row, track) {
    const fact = row.facts[track];
    return Boolean(fact) && fact.done < fact.expected;
  }

  return { columns, sorted, rank, lacking, isCut, text, dollars, DASH };
})();

/** An element of a drawing. */
function svg(tag, attributes, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) if (value !== null) made.setAttribute(name, value);
  made.append(...children.flat());
  return made;
}
