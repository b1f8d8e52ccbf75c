"use strict";
// Filters the rows. Without it, the page shows all of them.
const form = document.querySelector("form");
const rows = [...document.querySelectorAll("tbody tr")];
const shown = document.querySelector("#shown");
const filter = () => {
  const words = form.elements.text.value.toLowerCase().split(/\s+/).filter(Boolean);
  const state = form.elements.state.value;
  let count = 0;
  for (const row of rows) {
    const text = row.textContent.toLowerCase();
    const isOf = state === "all" || row.dataset.state === state || (state === "changed" && row.querySelector(".changed"));
    const fits = isOf && words.every((word) => text.includes(word));
    row.hidden = !fits;
    count += fits ? 1 : 0;
  }
  shown.textContent = `${count} of ${rows.length} files shown`;
};
form.hidden = false;
form.addEventListener("input", filter);
form.addEventListener("submit", (event) => event.preventDefault());
filter();

// Blinks a view: the picture after shows the one before by turns. Where motion is unwanted, each press turns once.
const still = matchMedia("(prefers-reduced-motion: reduce)");
for (const button of document.querySelectorAll(".change button")) {
  const find = (name) => button.closest(".changed").querySelector(`${name} img`);
  const [before, after] = [find(".before"), find(".after")];
  if (!before || !after) continue;
  const sources = [after.src, before.src];
  let turn = 0;
  let timer = 0;
  const show = (next) => { turn = next; after.src = sources[turn]; };
  const press = () => {
    if (still.matches) {
      show(1 - turn);
      button.setAttribute("aria-pressed", String(turn === 1));
    } else if (timer) {
      clearInterval(timer);
      timer = 0;
      show(0);
      button.setAttribute("aria-pressed", "false");
    } else {
      timer = setInterval(() => show(1 - turn), 600);
      button.setAttribute("aria-pressed", "true");
    }
  };
  button.hidden = false;
  button.addEventListener("click", press);
}
