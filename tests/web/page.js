({
  // What tests read from a page: an expression whose value has a function for each question.

  // The number of pixels of a canvas that are drawn.
  painted: (canvas) => {
    const copy = new OffscreenCanvas(canvas.width, canvas.height);
    const context = copy.getContext("2d", { willReadFrequently: true });
    context.drawImage(canvas, 0, 0);
    const { data } = context.getImageData(0, 0, canvas.width, canvas.height);
    return new Uint32Array(data.buffer).filter((pixel) => pixel >>> 24).length;
  },

  // Faults of structure: things without a name, headings that jump, references to nothing, and
  // parts that scroll but cannot be reached by keyboard.
  structure: () => {
    const seen = (one) => one.checkVisibility();
    const all = (selector) => [...document.querySelectorAll(selector)].filter(seen);
    const named = (one) => one.getAttribute("aria-label") || one.getAttribute("alt")
      || one.textContent.trim() || one.labels?.[0]?.textContent.trim()
      || one.querySelector("img")?.alt;
    const levels = all("h1, h2, h3, h4").map((one) => Number(one.tagName[1]));
    const ids = [...document.querySelectorAll("[id]")].map((one) => one.id);
    const refer = ["aria-controls", "aria-labelledby", "aria-activedescendant"];
    const within = "a[tabindex='0'], button, a:not([tabindex])";
    return {
      nameless: all("a, button, input, select, summary, img, [role=img]")
        .filter((one) => !named(one)).map((one) => one.outerHTML.slice(0, 80)),
      h1: levels.filter((level) => level === 1).length,
      jumps: levels.filter((level, i) => i && level > levels[i - 1] + 1),
      twice: ids.filter((id, i) => ids.indexOf(id) !== i),
      lost: refer.flatMap((name) => all(`[${name}]`).map((one) => one.getAttribute(name)))
        .filter((id) => !document.getElementById(id)),
      unreached: all("*").filter((one) => {
        const { overflowX, overflowY } = getComputedStyle(one);
        const isLarger = one.scrollHeight > one.clientHeight + 1
          || one.scrollWidth > one.clientWidth + 1;
        return /auto|scroll/.test(overflowX + overflowY) && isLarger && one.tabIndex < 0
          && !one.querySelector(within);
      }).map((one) => one.className),
    };
  },

  // Texts that stand out too little from what is behind them, with their ratio (WCAG AA: 4.5).
  contrast: () => {
    const parse = (text) => text.match(/[\d.]+/g).map(Number);
    const over = (top, below) => {
      const a = top[3] ?? 1;
      return [0, 1, 2].map((i) => a * top[i] + (1 - a) * below[i]);
    };
    const light = (rgb) => rgb.map((x) => x / 255)
      .map((x) => (x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4))
      .reduce((sum, x, i) => sum + x * [0.2126, 0.7152, 0.0722][i], 0);
    const ownText = (one) => [...one.childNodes].filter((n) => n.nodeType === 3)
      .map((n) => n.data.trim()).join("");
    const wrong = [];
    for (const one of document.querySelectorAll("body *")) {
      const isSeen = one.getBoundingClientRect().width > 3;
      if (!ownText(one) || !isSeen || one.closest("svg, script, style, noscript")) continue;
      const layers = [];
      for (let at = one; at; at = at.parentElement) {
        layers.unshift(parse(getComputedStyle(at).backgroundColor));
      }
      const ground = layers.reduce((below, top) => over(top, below), [255, 255, 255]);
      const ink = over(parse(getComputedStyle(one).color), ground);
      const [a, b] = [light(ink), light(ground)].sort((x, y) => y - x);
      const ratio = (a + 0.05) / (b + 0.05);
      if (ratio < 4.5) wrong.push(`${ownText(one).slice(0, 30)}: ${ratio.toFixed(2)}`);
    }
    return wrong;
  },

  // SHA-256 of the bytes of a picture.
  digest: async (image) => {
    const bytes = await (await fetch(image.src)).arrayBuffer();
    const sum = new Uint8Array(await crypto.subtle.digest("SHA-256", bytes));
    return [...sum].map((one) => one.toString(16).padStart(2, "0")).join("");
  },
})
