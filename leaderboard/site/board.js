"use strict";
// Sort a table by the heading that was clicked; rows without a number always come last.
function sortBy(heading) {
  const rows = heading.closest("table").tBodies[0];
  const ascending = heading.getAttribute("aria-sort") !== "ascending";
  const text = heading.querySelector("button").hasAttribute("data-text");
  const key = (row) => {
    const cell = row.cells[heading.cellIndex];
    if (!cell.hasAttribute("data-sort")) return null;
    return text ? cell.dataset.sort : Number(cell.dataset.sort);
  };
  const order = (one, other) => {
    const a = key(one), b = key(other);
    if (a === null || b === null) return (a === null) - (b === null);
    const difference = text ? a.localeCompare(b) : a - b;
    return ascending ? difference : -difference;
  };
  for (const other of heading.parentNode.cells) other.removeAttribute("aria-sort");
  heading.setAttribute("aria-sort", ascending ? "ascending" : "descending");
  rows.append(...Array.from(rows.rows).sort(order));
}

// Show only the chosen split and score; without this script the page shows all of them.
function show(form) {
  const wanted = { split: form.elements.split.value, metric: form.elements.metric.value };
  for (const section of document.querySelectorAll("section[data-split]")) {
    section.hidden = Object.entries(wanted).some(
      ([name, value]) => name in section.dataset && section.dataset[name] !== value
    );
  }
}

for (const button of document.querySelectorAll(".board thead button")) {
  button.addEventListener("click", () => sortBy(button.closest("th")));
}
const form = document.querySelector("form.controls");
form.addEventListener("change", () => show(form));
show(form);
