/* Tables that are wider than the page can be scrolled by keyboard, and parts have names of their own. */
document$.subscribe(() => requestAnimationFrame(() => {
  document.querySelectorAll(".md-typeset__scrollwrap").forEach((one, n) => {
    one.tabIndex = 0;
    one.setAttribute("role", "region");
    one.setAttribute("aria-label", `Table ${n + 1}`);
  });
  document.querySelectorAll(".md-code__nav").forEach((one, n) => one.setAttribute("aria-label", `Code ${n + 1}`));
}));
