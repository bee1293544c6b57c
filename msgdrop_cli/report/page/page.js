"use strict";
// Filters by word and text, sorts, copies commands. The page says all it has to say without it.
document.documentElement.classList.add("scripted");
const all = (selector, from = document) => [...from.querySelectorAll(selector)];
const find = document.getElementById("find"), found = document.getElementById("found");
const buttons = all(".counts button"), claims = all(".claim"), sections = all("section.figure");

function filter() {
  const words = buttons.filter(b => b.ariaPressed === "true").map(b => b.dataset.word);
  const terms = find.value.toLowerCase().split(/\s+/).filter(Boolean);
  for (const claim of claims) {
    const text = claim.dataset.find;
    claim.hidden = (words.length > 0 && !words.includes(claim.dataset.word))
      || !terms.every(term => text.includes(term));
  }
  for (const section of sections) {
    let any = false;
    for (const sentence of all(".sentence", section)) {
      sentence.hidden = section.classList.contains("sorted")
        || !following(sentence).some(claim => !claim.hidden);
    }
    any = all(".claim", section).some(claim => !claim.hidden);
    section.hidden = !any;
  }
  const shown = claims.filter(claim => !claim.hidden).length;
  found.textContent = `${shown} of ${claims.length} claims`;
}

function following(sentence) {
  const rows = [];
  for (let next = sentence.nextElementSibling; next && !next.matches(".sentence"); next = next.nextElementSibling) rows.push(next);
  return rows;
}

function sortable(table) {
  const claimsTable = table.matches(".claims");
  const original = claimsTable ? [...table.tBodies] : [...table.tBodies[0].rows];
  const parent = claimsTable ? table : table.tBodies[0];
  all("thead th[data-sort]", table).forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = head.textContent;
    head.replaceChildren(button);
    button.addEventListener("click", () => {
      const order = { none: "ascending", ascending: "descending", descending: "none" }[head.ariaSort ?? "none"];
      all("thead th", table).forEach(each => each.removeAttribute("aria-sort"));
      if (order !== "none") head.ariaSort = order;
      const rows = original.filter(row => !row.matches(".sentence"));
      if (order !== "none") rows.sort(comparing(column, head.dataset.sort, order === "descending"));
      table.closest("section")?.classList.toggle("sorted", order !== "none");
      parent.append(...(order === "none" ? original : [...original.filter(row => row.matches(".sentence")), ...rows]));
      filter();
    });
  });
}

function comparing(column, kind, down) {
  const key = row => (row.matches("tr") ? row : row.rows[0]).cells[column];
  const value = row => key(row).dataset.v ?? key(row).textContent;
  return (a, b) => {
    const x = value(a), y = value(b);
    if (x === "" || y === "") return (x === "") - (y === "");  // what is not known goes last
    const order = kind === "number" ? Number(x) - Number(y) : x.localeCompare(y, "en", { numeric: true });
    return down ? -order : order;
  };
}

function copying(code) {
  const button = document.createElement("button");
  button.type = "button";
  button.className = "copy";
  button.textContent = "copy";
  button.addEventListener("click", async () => {
    await navigator.clipboard.writeText(code.textContent);
    button.textContent = "copied";
  });
  code.after(button);
}

function open() {
  const target = location.hash.length > 1 && document.getElementById(decodeURIComponent(location.hash.slice(1)));
  const details = target && target.querySelector(".more details");
  if (target && target.matches(".claim")) details.open = true;
}

buttons.forEach(button => button.addEventListener("click", () => {
  button.ariaPressed = String(button.ariaPressed !== "true");
  filter();
}));
find.addEventListener("input", filter);
find.form.addEventListener("submit", event => event.preventDefault());
all(".claims, .overview").forEach(sortable);
if (navigator.clipboard) all(".command").forEach(copying);
addEventListener("hashchange", open);
open();
filter();
