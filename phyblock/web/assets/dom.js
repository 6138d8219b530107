/* Elements, words and numbers. Every text goes in as a text node: nothing a model said is ever read
   as markup. */
"use strict";

/** An element with attributes (on* are listeners) and children; text stays text. */
function el(tag, attributes = {}, ...children) {
  return filled(document.createElement(tag), attributes, children);
}

/** An element of a drawing. */
function svg(tag, attributes = {}, ...children) {
  return filled(document.createElementNS("http://www.w3.org/2000/svg", tag), attributes, children);
}

function filled(made, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (name === "style") Object.assign(made.style, value);
    else made.setAttribute(name, value === true ? "" : value);
  }
  // One by one: a call takes only so many arguments.
  for (const child of children.flat(Infinity)) if (child !== null && child !== undefined) made.append(child);
  return made;
}

/** A labelled choice of [value, text] pairs. */
function choice(id, label, options, now, act) {
  return el("label", { class: "choice" }, el("span", {}, label),
    el("select", { id, onchange: (event) => act(event.target.value) },
      options.map(([value, text]) => el("option", { value, selected: value === now }, text))));
}

const mean = (values) => values.reduce((sum, one) => sum + one, 0) / values.length;

/** A part that is scrolled sideways, by keyboard too. */
const scrolled = (label, ...children) =>
  el("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": label }, children);

/** Names and values side by side; those without a value are left out. */
const listOf = (pairs, kind = "about") => el("dl", { class: kind },
  pairs.filter(([, value]) => value !== null && value !== undefined && value !== "")
    .map(([name, value]) => el("div", {}, el("dt", {}, name), el("dd", { class: "number" }, value))));

const Words = (() => {
  const DASH = "–";
  const names = {
    ok: "OK", parse_failure: "Parse failure", refusal: "Refusal", truncated: "Truncated",
    api_error: "API error", missing: "Missing",
    shape_not_in_gt: "Shape not in GT", overflow: "Overflow",
    incorrect_orientation: "Incorrect orientation", dependency_not_met: "Dependency not met",
    wrong_kind: "Wrong kind", wrong_rotation: "Wrong rotation", too_early: "Too early",
    off_sideways: "Off sideways", off_height: "Off in height", interpenetrating: "Interpenetrating",
    floating: "Floating", toppling: "Toppling others",
    invalid: "No such candidate", done: "Done", placed: "Placed",
    completed: "goal completed", collapsed: "it collapsed", unanswered: "no answer came",
    max_steps: "step limit", max_failures: "too many failures in a row",
    max_repeats: "the same failure again and again", max_tokens: "token limit", max_cost: "cost limit",
    semi_cylinder: "semi-cylinder",
    cuboid1: "cuboid 1", cuboid2: "cuboid 2", cuboid3: "cuboid 3",
  };
  /** The name that people use for a name of the data. */
  const named = (name) => names[name] || String(name).replaceAll("_", " ");
  const reasons = {
    shape_not_in_gt: (block) => `the goal has no ${block}`,
    overflow: (block) => `every ${block} of the goal is already placed`,
    incorrect_orientation: (block, turned) => `the goal has no ${block} in this orientation${turned && `; in the right one: ${turned}`}`,
    dependency_not_met: (block, turned, below) => `too early: ${below || "what it rests on"} must come first`,
  };
  /**
   * The reason why a step was wrong, as a part of a sentence: `turned` are the candidates that are
   * turned as the goal needs, `below` those that must be placed before; all of them in words.
   */
  const reason = (why, block = "such block", turned = "", below = "") =>
    (reasons[why] ? reasons[why](block, turned, below) : named(why));
  /** With so many decimals, ties to even as in tables: toFixed goes up, so that 6.25 would be 6.3. */
  const fixed = (value, digits = 1) => {
    // A tie is an odd number of halves of the last place, which only such sums of halves can be.
    const isTie = Math.abs((value * 2 ** (digits + 1)) % 2) === 1;
    const below = Math.floor(Math.abs(value) * 10 ** digits);
    return isTie && below % 2 === 0 ? (Math.sign(value) * (below / 10 ** digits)).toFixed(digits) : value.toFixed(digits);
  };
  /** A number with so many decimals and commas; a dash for none. */
  const number = (value, digits = 1) => (value === null || value === undefined ? DASH
    : Number(fixed(value, digits)).toLocaleString("en", { minimumFractionDigits: digits, maximumFractionDigits: digits }));
  const dollars = (value) => (value === null || value === undefined ? DASH
    : value === 0 ? "0" : value >= 1 ? number(value, 2) : value.toPrecision(2));
  const count = (n, noun) => `${n.toLocaleString("en")} ${noun}${n === 1 ? "" : "s"}`;
  const block = (one) => `${one.color} ${named(one.type)}`;
  return { DASH, named, reason, fixed, number, dollars, count, block };
})();
