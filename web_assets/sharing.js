/* A link to what the page shows, into the clipboard; extends window.oasis of shell.js, once per page. */
(function () {
  "use strict";
  const oasis = window.oasis;
  if (oasis.copyLink) return;

  const link = () => {
    const url = new URL(location.href);
    for (const name of [...url.searchParams.keys()]) {
      if (!["object", "keyframe", "map"].includes(name)) url.searchParams.delete(name);
    }
    url.hash = "";
    // The finding whose evidence is read: the address may still be on its way there.
    const shown = document.querySelector("[data-evidence]");
    if (shown) url.searchParams.set("object", shown.getAttribute("data-evidence"));
    return url.href;
  };
  // Browsers give the clipboard to secure pages only: neither plain HTTP on a network, nor some frames.
  const copyPlainly = (text) => {
    const field = document.body.appendChild(document.createElement("textarea"));
    field.value = text;
    field.style.cssText = "position:fixed;opacity:0";
    field.select();
    const copied = document.execCommand("copy");
    field.remove();
    return copied;
  };
  const copyLink = async () => {
    const text = link();
    let copied = false;
    try { await navigator.clipboard.writeText(text); copied = true; } catch (error) { copied = copyPlainly(text); }
    oasis.toast(copied ? `Link copied: ${text}` : `Copy this link: ${text}`);
  };

  document.addEventListener("click", (event) => {
    if (event.target instanceof Element && event.target.closest("[data-copy-link]")) copyLink();
  });
  Object.assign(oasis, { copyLink });
})
