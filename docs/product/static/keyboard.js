// The drawers of narrow screens, by keyboard: their buttons can be focused, and Escape closes them.
"use strict";

const DRAWERS = ["__navigation", "__toc"];

function toggleOf(id) {
  return document.getElementById(id);
}

function open(id, isOpen) {
  toggleOf(id).checked = isOpen;
  for (const label of document.querySelectorAll(`label[role=button][for=${id}]`)) label.setAttribute("aria-expanded", isOpen);
}

function prepareButtons(id) {
  for (const label of document.querySelectorAll(`label[for=${id}]:not(.overlay)`)) {
    label.tabIndex = 0;
    label.setAttribute("role", "button");
    label.setAttribute("aria-label", id === "__toc" ? "Contents of this page" : "Pages");
    label.setAttribute("aria-expanded", "false");
    label.addEventListener("keydown", (event) => {
      if (event.key !== "Enter" && event.key !== " ") return;
      event.preventDefault();
      open(id, !toggleOf(id).checked);
    });
  }
  toggleOf(id).addEventListener("change", () => open(id, toggleOf(id).checked));
}

/** Close the open drawer, and focus its button. */
function close() {
  for (const id of DRAWERS.filter((each) => toggleOf(each)?.checked)) {
    open(id, false);
    [...document.querySelectorAll(`label[role=button][for=${id}]`)].find((label) => label.checkVisibility())?.focus();
  }
}

document.addEventListener("DOMContentLoaded", () => {
  DRAWERS.filter(toggleOf).forEach(prepareButtons);
  document.addEventListener("keydown", (event) => { if (event.key === "Escape") close(); });
});

/** Open the drawer with the search before Sphinx focuses it. */
document.addEventListener("keydown", (event) => {
  const box = document.querySelector(".sidebar-search");
  const isTyping = event.target.closest("input, textarea, select");
  if (event.key !== "/" || !box || isTyping || event.ctrlKey || event.metaKey || event.altKey) return;
  if (!box.checkVisibility({ visibilityProperty: true })) open("__navigation", true);
}, true);
