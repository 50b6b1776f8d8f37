// What scrolls sideways can be reached by keys; the theme wraps tables when the page is there.
addEventListener("load", () => {
  const reach = new ResizeObserver((seen) => {
    for (const { target } of seen) target.tabIndex = target.scrollWidth > target.clientWidth ? 0 : -1;
  });
  document.querySelectorAll(".md-typeset__scrollwrap").forEach((each) => reach.observe(each));
});
