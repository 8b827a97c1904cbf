// Follows the wall: puts in the tiles that have changed, and says so when nothing comes any more.
"use strict";
(() => {
  const tiles = document.getElementById("tiles");
  const own = document.getElementById("tile");
  const summary = document.getElementById("summary");
  const said = document.getElementById("said");
  const lost = document.getElementById("lost");
  const SILENT_MS = 5000;
  let heard = Date.now();

  const place = (cell) => {
    if (own) return own.dataset.cell === cell ? own : null;
    for (const child of tiles.children) if (child.dataset.cell === cell) return child;
    const made = document.createElement("div");
    made.dataset.cell = cell;
    tiles.append(made);
    return made;
  };

  const state = (element) => element.querySelector(".badge")?.textContent.trim() ?? "";

  const put = (cell, html) => {
    const element = place(cell);
    if (!element) return;
    const before = state(element);
    const focused = element.contains(document.activeElement);
    element.innerHTML = html;
    if (focused) element.querySelector("a")?.focus({ preventScroll: true });
    const now = state(element);
    if (said && before && before !== now) said.textContent = `${cell}: ${now}`;
  };

  const sort = (order) => {
    const rank = new Map(order.map((cell, at) => [cell, at]));
    const sorted = [...tiles.children].sort((a, b) => rank.get(a.dataset.cell) - rank.get(b.dataset.cell));
    const focus = document.activeElement;
    for (const child of sorted) {
      if (rank.has(child.dataset.cell)) tiles.append(child);
      else child.remove();
    }
    if (tiles.contains(focus)) focus.focus({ preventScroll: true });
  };

  const cut = (is) => {
    document.body.classList.toggle("cut", is);
    lost.hidden = !is;
  };

  const events = new EventSource(own ? `/cells/${own.dataset.cell}/events` : "/events");
  events.addEventListener("wall", (event) => {
    heard = Date.now();
    cut(false);
    const news = JSON.parse(event.data);
    for (const [cell, html] of Object.entries(news.tiles)) put(cell, html);
    if (summary) summary.innerHTML = news.summary;
    if (tiles && news.order) {
      sort(news.order);
      if (news.order.length) document.getElementById("empty")?.remove();
    }
  });
  events.addEventListener("error", () => {
    // A server that refuses is asked again by hand: the browser asks only while the connection breaks.
    if (events.readyState === EventSource.CLOSED) setTimeout(() => location.reload(), SILENT_MS);
  });
  setInterval(() => cut(Date.now() - heard > SILENT_MS), 500);
})();
