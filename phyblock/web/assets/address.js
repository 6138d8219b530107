/* What is seen, as the part of the address behind "#": a view, and words that say the rest. */
"use strict";

const Address = (() => {
  const WAIT_MS = 250;
  let describe = () => location.hash;
  let waiting = 0;
  let shown = location.hash;

  /** The view that the address names, and its words. */
  function read() {
    shown = location.hash;
    const [view, query] = location.hash.slice(1).split(/\?(.*)/s);
    return { view: view || "results", words: new URLSearchParams(query || "") };
  }

  /** An address of a view; words without a value are left out. */
  function text(view, words = {}) {
    const given = Object.entries(words).filter(([, word]) => word !== "" && word !== null && word !== undefined);
    const query = new URLSearchParams(given).toString();
    return `#${view}${query ? `?${query}` : ""}`;
  }

  /** Write what is seen: as a place of its own that Back leads to, or over the present one. */
  function note(isNew = false) {
    clearTimeout(waiting);
    const seen = describe();
    // Back may have gone to another place that is not shown yet: it is not written over.
    if (seen === location.hash || (!isNew && location.hash !== shown)) return;
    history[isNew ? "pushState" : "replaceState"](null, "", seen);
    shown = location.hash;
  }

  /** Write over the present place once nothing has changed for a while: browsers ration it. */
  function soon() {
    clearTimeout(waiting);
    waiting = setTimeout(note, WAIT_MS);
  }

  return {
    read, text, note, soon,
    /** A function of no arguments says what is seen. */
    start: (say) => {
      describe = say;
    },
    /** Forget what waits to be written: another place was gone to. */
    forget: () => clearTimeout(waiting),
  };
})();
