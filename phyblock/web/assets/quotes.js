/* Where in a reply each step of a plan stands: the sentence that names its candidate. */
"use strict";

const Quotes = (() => {
  const MOST_TRIES = 400;
  const LONGEST = 240;
  const LABEL = /^[\s>*_#|([{"'-]*(?:(?:step|move|action)[\s_]*#?)?\d{1,3}["'\s]*[.):|\]*]+/i;
  const NAMED = /(?:\bindex|\bmove\()[\s"'#:=]*(\d{1,6})/gi;

  /** Numbers that a text calls an index or moves, with their places. */
  const named = (text) => [...text.matchAll(NAMED)].map((one) =>
    ({ n: Number(one[1]), at: one.index + one[0].length - one[1].length }));

  /** All numbers of a text with their places, without those that only count steps. */
  function numbers(text) {
    const found = [];
    let at = 0;
    for (const line of text.split("\n")) {
      const label = line.match(LABEL)?.[0].length || 0;
      const skipped = /\d/.test(line.slice(label)) ? label : 0;
      for (const one of line.slice(skipped).matchAll(/\d{1,6}/g)) {
        found.push({ n: Number(one[0]), at: at + skipped + one.index });
      }
      at += line.length + 1;
    }
    return found;
  }

  /** Places of a plan's numbers among `known`, in order and close together; null: they are not. */
  function places(known, plan) {
    let best = null;
    let tries = 0;
    for (let end = known.length - 1; end >= 0 && tries < MOST_TRIES; end--) {
      if (known[end].n !== plan[plan.length - 1]) continue;
      tries++;
      const found = [];
      let step = plan.length - 1;
      for (let i = end; i >= 0 && step >= 0; i--) {
        if (known[i].n === plan[step]) {
          found.unshift(known[i].at);
          step--;
        }
      }
      if (step >= 0) continue;
      const length = found[found.length - 1] - found[0];
      if (!best || length < best.length) best = { length, found };
    }
    return best && best.found;
  }

  /** The sentence of a text that holds a place; a line ends a sentence too. */
  function sentence(text, at) {
    const from = text.lastIndexOf("\n", at - 1) + 1;
    const end = text.indexOf("\n", at);
    const line = text.slice(from, end < 0 ? text.length : end);
    const label = line.match(LABEL)?.[0].length || 0;
    let start = 0, stop = line.length;
    for (const found of line.matchAll(/[.!?]\s+(?=[A-Z*"“(])/g)) {
      // The full stop behind a number of a list ends nothing.
      if (found.index < label) continue;
      const next = found.index + found[0].length;
      if (from + next > at) {
        stop = next;
        break;
      }
      start = next;
    }
    const said = line.slice(start, stop).trim();
    return said.length <= LONGEST ? said : `… ${text.slice(Math.max(from, at - LONGEST / 2), at + LONGEST / 2).split("\n")[0]} …`;
  }

  /**
   * For each step of a plan the sentence that it was read in; null where none can be told.
   *
   * `orAny`: numbers that the text does not call an index may be meant, too.
   */
  function ofPlan(text, plan, orAny = true) {
    const found = text && plan.length
      ? places(named(text), plan) || (orAny ? places(numbers(text), plan) : null) : null;
    return plan.map((_, i) => (found ? sentence(text, found[i]) : null));
  }

  /** The sentences behind the steps of a record. */
  function of({ reply, parse, turns, pose }, steps) {
    if (!turns) return ofPlan(reply?.text || "", parse?.plan || [], !pose);
    return steps.map(({ turn, number }) =>
      (Number.isInteger(number) ? ofPlan(turn.reply?.text || "", [number])[0] : null));
  }

  return { of };
})();
