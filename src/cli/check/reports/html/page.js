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
    const fits = (state === "all" || row.dataset.state === state) && words.every((word) => text.includes(word));
    row.hidden = !fits;
    count += fits ? 1 : 0;
  }
  shown.textContent = `${count} of ${rows.length} files shown`;
};
form.hidden = false;
form.addEventListener("input", filter);
form.addEventListener("submit", (event) => event.preventDefault());
filter();
