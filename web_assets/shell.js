/* The page around viser's panels. Runs once per page; a reconnected page gets it again and only takes the
   new connection over. Everything that crosses to the server goes through send(), as one event after the
   other; the server calls the functions of window.oasis. */
(function (options) {
  "use strict";
  if (window.oasis) { window.oasis.connect(options); return; }

  const SEND_INTERVAL_MS = 40;
  const root = document.documentElement;
  const viser = () => window.__viserMutable;
  let connection = options;

  const element = (id, tag, parent) => {
    let found = document.getElementById(id);
    if (!found) {
      found = document.createElement(tag);
      found.id = id;
      (parent || document.body).appendChild(found);
    }
    return found;
  };
  const style = element("oa-style", "style", document.head);
  const selectionStyle = element("oa-selection", "style", document.head);

  /* ---- events to the server ---- */

  let sent = 0;
  const send = (kind, value) => {
    const mutable = viser();
    if (!mutable || !mutable.sendMessage) return;
    // The number makes equal events differ: viser drops an update to the value that it already has.
    const text = JSON.stringify({ k: kind, v: value === undefined ? null : value, n: ++sent });
    mutable.sendMessage({ type: "GuiUpdateMessage", uuid: connection.bridge, updates: { value: text } });
  };
  const throttled = new Map();
  const sendThrottled = (kind, value) => {
    const waiting = throttled.get(kind);
    if (waiting) { waiting.value = value; waiting.stale = true; return; }
    const entry = { value, stale: false };
    throttled.set(kind, entry);
    send(kind, value);
    setTimeout(() => {
      throttled.delete(kind);
      if (entry.stale) sendThrottled(kind, entry.value);
    }, SEND_INTERVAL_MS);
  };

  const declaredValue = (source) => {
    const text = source.getAttribute("data-value");
    if (text === null) return null;
    try { return JSON.parse(text); } catch (error) { return text; }
  };
  const inputValue = (input) => {
    let value = input.value;
    if (input.type === "checkbox") value = input.checked;
    else if (input.type === "range" || input.type === "number") value = Number(input.value);
    const key = input.getAttribute("data-key");
    return key === null ? value : { key, value };
  };
  const isField = (node) => node.matches("input, select, textarea");

  document.addEventListener("click", (event) => {
    if (!(event.target instanceof Element)) return;
    const opener = event.target.closest("[data-open]");
    if (opener) { window.oasis.open(opener.getAttribute("data-open")); return; }
    const sender = event.target.closest("[data-send]");
    if (sender && !isField(sender)) {
      if (!sender.disabled) send(sender.getAttribute("data-send"), declaredValue(sender));
      return;
    }
    const picture = event.target.closest("[data-pixel]");
    if (picture) sendPixel(picture, event);
  });
  document.addEventListener("input", (event) => {
    const field = event.target;
    if (!(field instanceof Element) || !field.hasAttribute("data-send") || !isField(field)) return;
    sendThrottled(field.getAttribute("data-send"), inputValue(field));
  });
  // A slider that keeps the focus swallows all keyboard commands.
  document.addEventListener("pointerup", (event) => {
    const field = event.target;
    if (field instanceof HTMLInputElement && field.type === "range" && field.closest(".oa")) field.blur();
  }, true);

  const sendPixel = (holder, event) => {
    const image = holder.matches("img") ? holder : holder.querySelector("img");
    if (!image || !image.naturalWidth) return;
    const box = image.getBoundingClientRect();
    let [left, top, width, height] = [box.left, box.top, box.width, box.height];
    if (getComputedStyle(image).objectFit === "contain") {
      const scale = Math.min(width / image.naturalWidth, height / image.naturalHeight);
      left += (width - image.naturalWidth * scale) / 2;
      top += (height - image.naturalHeight * scale) / 2;
      width = image.naturalWidth * scale;
      height = image.naturalHeight * scale;
    }
    const u = (event.clientX - left) / width, v = (event.clientY - top) / height;
    if (!(u >= 0 && u <= 1 && v >= 0 && v <= 1)) return;
    const { session, keyframe, pixel } = holder.dataset;
    send(pixel, { session: Number(session), keyframe: Number(keyframe), u, v });
  };

  /* ---- regions ---- */

  const region = (name) => {
    const found = element("oa-" + name, "div");
    found.classList.add("oa");
    return found;
  };
  let swapsAsked = 0, swapShown = 0;
  const setHtml = (name, html) => {
    if (name === "band") swapShown = ++swapsAsked;
    region(name).innerHTML = html;
  };
  const parts = (holder) => new Map(
    [...holder.querySelectorAll("[data-part]")].map((part) => [part.getAttribute("data-part"), part]));
  const swapBand = async (html) => {
    const asked = ++swapsAsked;
    const template = document.createElement("div");
    template.innerHTML = html;
    // Decoded before they are shown: an image that is still loading would flash empty.
    await Promise.all([...template.querySelectorAll("img")].map((image) => {
      image.loading = "eager";
      return image.decode().catch(() => undefined);
    }));
    if (asked < swapShown) return;  // a later answer was quicker
    swapShown = asked;
    const band = region("band");
    const old = parts(band), fresh = parts(template);
    const same = old.size > 0 && old.size === fresh.size && [...fresh.keys()].every((name) => old.has(name));
    if (!same) { band.innerHTML = html; return; }
    for (const [name, part] of fresh) {
      const shown = old.get(name);
      if (!isField(part)) { shown.replaceWith(part); continue; }
      if (document.activeElement === shown) continue;  // being dragged: what the hand does counts
      for (const { name: attribute, value } of [...part.attributes]) shown.setAttribute(attribute, value);
      if (part.type === "checkbox") shown.checked = part.checked; else shown.value = part.value;
    }
  };

  let toastTimer = 0;
  const toast = (message, undo) => {
    const box = element("oa-toast", "div");
    box.className = "oa";
    box.setAttribute("role", "status");
    box.textContent = message;
    if (undo) {
      const button = document.createElement("button");
      button.textContent = "Undo";
      button.onclick = () => { send("undo"); box.classList.remove("oa-shown"); };
      box.appendChild(button);
    }
    box.classList.add("oa-shown");
    clearTimeout(toastTimer);
    toastTimer = setTimeout(() => box.classList.remove("oa-shown"), undo ? 8000 : 4000);
  };

  /* ---- selection ---- */

  const setAddress = (values) => {
    const url = new URL(location.href);
    for (const [name, value] of Object.entries(values)) {
      if (value === null) url.searchParams.delete(name); else url.searchParams.set(name, value);
    }
    history.replaceState(history.state, "", url);
  };
  const setSelection = (objectId) => {
    setAddress({ object: objectId });
    if (objectId === null) { selectionStyle.textContent = ""; return; }
    const selector = `[data-object="${objectId}"]`;
    // A rule, not a class: React redraws the panels and would lose a class that it does not know of.
    selectionStyle.textContent = `${selector}{background:color-mix(in srgb,var(--oa-accent) 16%,` +
      `var(--oa-ground))!important;outline:1px solid var(--oa-accent);outline-offset:-1px}`;
    let tries = 0;
    const reveal = () => {
      const row = document.querySelector(`.oa ${selector}`);
      if (row) row.scrollIntoView({ block: "nearest" });
      else if (++tries < 20) setTimeout(reveal, 100);  // the panel with the row may still be on its way
    };
    reveal();
  };

  /* ---- what this browser remembers: tastes, for every result; places are in the address ---- */

  const STORED = "oasisview";
  const remember = (tastes) => {
    try { localStorage.setItem(STORED, JSON.stringify(tastes)); } catch (error) { /* private window */ }
  };
  const remembered = () => {
    try { return JSON.parse(localStorage.getItem(STORED)); } catch (error) { return null; }
  };

  /* ---- camera ---- */

  const flyTo = (position, lookAt) => {
    const mutable = viser();
    const controls = mutable.cameraControl;
    const Vector = mutable.camera.position.constructor;
    const eye = new Vector(...position), target = new Vector(...lookAt);
    const world = mutable.nodeRefFromName[""];
    if (world) {
      world.updateWorldMatrix(true, false);
      eye.applyMatrix4(world.matrixWorld);
      target.applyMatrix4(world.matrixWorld);
    }
    const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
    const usual = flyTo.usualSmoothTime ?? (flyTo.usualSmoothTime = controls.smoothTime);
    const flight = (flyTo.flights = (flyTo.flights || 0) + 1);
    controls.smoothTime = 0.22;
    controls.setLookAt(eye.x, eye.y, eye.z, target.x, target.y, target.z, !still).then(() => {
      if (flight === flyTo.flights) controls.smoothTime = usual;
    });
    if (mutable.requestRender) mutable.requestRender();
  };

  /* ---- layout and connection ---- */

  let observed = null;
  const layout = () => {
    const canvas = viser() && viser().canvas;
    if (!canvas) return;
    if (canvas !== observed) {
      observed = canvas;
      // The box that holds the 3D view; style.css makes room for the band below it.
      canvas.parentElement.parentElement.setAttribute("data-oa-view", "");
      new ResizeObserver(layout).observe(canvas);
    }
    const box = canvas.getBoundingClientRect();
    root.style.setProperty("--oa-view-left", box.left + "px");
    root.style.setProperty("--oa-view-width", box.width + "px");
  };
  window.addEventListener("resize", layout);

  const connect = (fresh) => {
    connection = fresh;
    style.textContent = fresh.css;
    for (const name of fresh.regions) region(name);
    const waiting = setInterval(() => {
      if (!viser() || !viser().canvas || !viser().sendMessage) return;
      clearInterval(waiting);
      if (connection !== fresh) return;
      layout();
      const search = Object.fromEntries(new URLSearchParams(location.search));
      send("hello", {
        search: { object: search.object ?? null, keyframe: search.keyframe ?? null, map: search.map ?? null },
        remembered: remembered(), width: innerWidth, height: innerHeight,
      });
    }, 50);
  };

  window.O = send;
  window.oasis = {
    connect, send, element, isField, setHtml, swapBand, toast, setSelection, setAddress, remember, flyTo,
    options: () => connection,
  };
  connect(options);
})
