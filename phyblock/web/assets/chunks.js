/* Data beside the page, in scripts that are brought when they are needed: a page that was opened from
   disk may not fetch. Those that were not used for long are dropped. */
"use strict";

/**
 * Loads the page's data, which are deflated JSON in base 64; `noun` is what was written anew where a
 * script is of another build, `most` how many are kept.
 */
function chunksOf({ noun, most }) {
  const { folder, build } = document.documentElement.dataset;
  const waiting = new Map();
  const kept = new Map();

  window.phyblockTake = (builtAs, name, data) => {
    const waiter = waiting.get(name);
    if (!waiter) return;
    if (builtAs === build) waiter.settle(unpacked(data));
    else waiter.fail(new Error(`The ${noun} was written again since this page was opened: reload it.`));
  };

  async function unpacked(packed) {
    const bytes = Uint8Array.from(atob(packed), (letter) => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return JSON.parse(await new Response(stream).text());
  }

  function load(name) {
    // What was dropped while it is under way is waited for together.
    const found = kept.get(name) || waiting.get(name)?.found || brought(name);
    // The last one is the one that was used last.
    kept.delete(name);
    kept.set(name, found);
    if (kept.size > most) kept.delete(kept.keys().next().value);
    return found;
  }

  function brought(name) {
    const waiter = {};
    const found = waiter.found = new Promise((settle, fail) => Object.assign(waiter, { settle, fail }));
    waiting.set(name, waiter);
    const script = document.createElement("script");
    script.src = `${folder}/${name}.js`;
    script.onload = script.onerror = () => {
      script.remove();
      waiting.delete(name);
      waiter.fail(new Error(`${folder}/${name}.js is not there: the folder ${folder}/ belongs beside this page.`));
    };
    document.head.append(script);
    found.catch(() => kept.delete(name));
    return found;
  }

  /** Number `n` of what stands in chunks of one kind, which begin with the numbers `starts`. */
  async function entry(starts, kind, n) {
    let low = 0, high = starts.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (starts[middle] <= n) low = middle;
      else high = middle - 1;
    }
    return (await load(`${kind}-${low}`))[n - starts[low]];
  }

  return { load, entry, count: () => kept.size };
}
