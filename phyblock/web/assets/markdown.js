/* Markdown as models write it, as elements. Only what stands here is made: tags of HTML stay text,
   and nothing can be clicked or loaded. */
"use strict";

const Markdown = (() => {
  const LONGEST_LINE = 5_000;
  const LONGEST = 400_000;
  const DEEPEST = 8;
  const INLINE = /`([^`\n]+)`|\*\*(?=\S)([^\n]*?\S)\*\*|__(?=\S)([^\n]*?\S)__|\*(?=[^\s*])([^*\n]*?[^\s*])\*|(?<![\w])_(?=[^\s_])([^_\n]*?[^\s_])_(?![\w])|!?\[([^\]\n]*)\]\(([^()\s]*)\)|\\([!-/:-@[-`{-~])/g;
  const FENCE = /^\s{0,3}(```+|~~~+)\s*(\S*)/;
  const ITEM = /^(\s*)(?:([-*+])|(\d{1,9})[.)])\s+(.*)$/;
  const RULE = /^\s{0,3}(?:\*\s*){3,}$|^\s{0,3}(?:-\s*){3,}$|^\s{0,3}(?:_\s*){3,}$/;
  const DIVIDER = /^\s*\|?\s*:?-+:?\s*(?:\|\s*:?-+:?\s*)*\|?\s*$/;

  /** Text with emphasis, code, links (whose address is shown, not followed). */
  function inline(text, depth = 0) {
    if (depth > DEEPEST || text.split("\n").some((line) => line.length > LONGEST_LINE)) return [text];
    const made = [];
    let from = 0;
    for (const found of text.matchAll(INLINE)) {
      made.push(text.slice(from, found.index));
      const [whole, code, bold, bold2, slant, slant2, label, address, escaped] = found;
      if (code !== undefined) made.push(el("code", {}, code));
      else if (bold ?? bold2) made.push(el("strong", {}, inline(bold ?? bold2, depth + 1)));
      else if (slant ?? slant2) made.push(el("em", {}, inline(slant ?? slant2, depth + 1)));
      else if (label !== undefined) made.push(whole[0] === "!" ? `[picture: ${label}] (${address})` : `${label} (${address})`);
      else made.push(escaped);
      from = found.index + whole.length;
    }
    made.push(text.slice(from));
    return made.filter((part) => part !== "");
  }

  /** The elements of a text; null where it is too long to be more than text. */
  function render(text) {
    if (text.length > LONGEST) return null;
    return blocks(text.split(/\r\n|[\n\r]/), 0);
  }

  function blocks(lines, depth) {
    const made = [];
    let at = 0;
    while (at < lines.length) {
      const line = lines[at];
      const fence = line.match(FENCE);
      const heading = line.match(/^\s{0,3}#{1,6}\s+(.*?)\s*#*\s*$/);
      if (!line.trim()) at++;
      else if (fence) at = fenced(lines, at, fence[1], made);
      else if (heading) {
        made.push(el("p", { class: "md-heading" }, inline(heading[1])));
        at++;
      } else if (RULE.test(line)) {
        made.push(el("hr"));
        at++;
      } else if (/^\s{0,3}>/.test(line) && depth < DEEPEST) {
        const to = until(lines, at, (one) => !/^\s{0,3}>/.test(one));
        made.push(el("blockquote", {}, blocks(lines.slice(at, to).map((one) => one.replace(/^\s{0,3}> ?/, "")), depth + 1)));
        at = to;
      } else if (line.includes("|") && DIVIDER.test(lines[at + 1] || "") && (lines[at + 1] || "").includes("|")) {
        at = table(lines, at, made);
      } else if (ITEM.test(line) && depth < DEEPEST) at = list(lines, at, made, depth);
      else {
        const to = until(lines, at + 1, (one) => starts(one, depth));
        made.push(el("p", {}, inline(lines.slice(at, to).join("\n"))));
        at = to;
      }
    }
    return made;
  }

  const starts = (line, depth) => !line.trim() || FENCE.test(line) || /^\s{0,3}#{1,6}\s/.test(line)
    || RULE.test(line) || (depth < DEEPEST && (ITEM.test(line) || /^\s{0,3}>/.test(line)));

  function until(lines, from, isEnd) {
    let at = from;
    while (at < lines.length && !isEnd(lines[at])) at++;
    return at;
  }

  function fenced(lines, from, mark, made) {
    const to = until(lines, from + 1, (one) => one.trim().startsWith(mark) && !one.trim().slice(mark.length).trim());
    made.push(el("pre", { class: "code", tabindex: 0 }, lines.slice(from + 1, to).join("\n")));
    return to + 1;
  }

  /** Items of one list; what is indented further, or goes on, belongs to the item above. */
  function list(lines, from, made, depth) {
    const [, indent, bullet] = lines[from].match(ITEM);
    const within = indent.replaceAll("\t", "    ").length;
    const items = [];
    let at = from;
    while (at < lines.length) {
      const item = lines[at].match(ITEM);
      const isOurs = item && item[1].replaceAll("\t", "    ").length <= within && Boolean(item[2]) === Boolean(bullet);
      if (!isOurs) break;
      const body = [item[4]];
      at++;
      while (at < lines.length) {
        const wide = lines[at].replaceAll("\t", "    ");
        const deep = wide.length - wide.trimStart().length;
        const isNext = lines[at].trim() ? deep > within : (lines[at + 1] || "").startsWith(`${indent}  `);
        if (!isNext) break;
        body.push(lines[at].trim() ? wide.slice(Math.min(deep, within + 2)) : "");
        at++;
      }
      items.push(el("li", item[3] ? { value: Number(item[3]) } : {}, tight(blocks(body, depth + 1))));
      // A blank line between items does not end the list.
      const after = until(lines, at, (one) => one.trim());
      if (ITEM.test(lines[after] || "")) at = after;
    }
    made.push(el(bullet ? "ul" : "ol", {}, items));
    return at;
  }

  /** A single paragraph in an item needs no element of its own. */
  const tight = (parts) => (parts[0]?.tagName === "P" && !parts[0].className
    ? [...parts[0].childNodes, ...parts.slice(1)] : parts);

  function table(lines, from, made) {
    const cells = (line) => line.trim().replace(/^\||\|$/g, "").split("|").map((cell) => inline(cell.trim()));
    const to = until(lines, from + 2, (one) => !one.includes("|"));
    made.push(el("div", { class: "scroll", tabindex: 0 }, el("table", {},
      el("thead", {}, el("tr", {}, cells(lines[from]).map((cell) => el("th", { scope: "col" }, cell)))),
      el("tbody", {}, lines.slice(from + 2, to).map((line) => el("tr", {}, cells(line).map((cell) => el("td", {}, cell))))))));
    return to;
  }

  return { render };
})();
