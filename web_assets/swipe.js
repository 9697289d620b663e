/* All before/after sliders of a page show one place: moving one moves the others. Once per page. */
(function () {
  "use strict";
  if (window.oasis.hasSwipes) return;
  window.oasis.hasSwipes = true;
  const root = document.documentElement;
  let shown = "50";

  const follow = (input) => { if (input.value !== shown) input.value = shown; };
  document.addEventListener("input", (event) => {
    const input = event.target;
    if (!(input instanceof Element) || !input.matches("[data-swipe]")) return;
    shown = input.value;
    root.style.setProperty("--oa-swipe", shown + "%");
    document.querySelectorAll("[data-swipe]").forEach(follow);
  });
  // Panels are redrawn with sliders in the middle: they take their place before they are touched.
  new MutationObserver(() => document.querySelectorAll("[data-swipe]").forEach(follow))
    .observe(document.body, { childList: true, subtree: true });
})
