// The theme and the search. The index is a script that is loaded when the search begins, because files cannot be fetched.
"use strict";

const remembered = {
  get theme() { try { return localStorage.getItem("msggen-theme"); } catch { return null; } },
  set theme(name) { try { localStorage.setItem("msggen-theme", name); } catch { /* the theme lasts for this page */ } },
};
if (remembered.theme) document.documentElement.dataset.theme = remembered.theme;

const MOST = 30;
const KINDS = {
  message: "message", service: "service", topic: "topic of the bridge", enum: "enum", guide: "guide",
  index: "page", messages: "page", topics: "page", enums: "page", nesting: "page", changes: "page",
};

/** Return how well a name matches: 0 is the name itself, 3 any part of it, and -1 is no match. */
function rank(name, word) {
  const text = name.toLowerCase();
  const at = text.indexOf(word);
  if (at < 0) return -1;
  if (text === word) return 0;
  if (at === 0) return 1;
  const isStart = /[^a-z0-9]/.test(text[at - 1]) || (name[at] !== text[at] && name[at - 1] === text[at - 1]);
  return isStart ? 2 : 3;
}

/** Return the worst rank of all words in a name, -1 if one is not in it, and 0 for no words. */
function rankAll(name, words) {
  const ranks = words.map((word) => rank(name, word));
  return ranks.includes(-1) ? -1 : Math.max(0, ...ranks);
}

/** Return the words of a name or a query: `NAV_STATE` and `NavState` have two. */
function wordsOf(name) {
  return name.replace(/([a-z0-9])([A-Z])/g, "$1 $2").toLowerCase().split(/[^a-z0-9]+/).filter(Boolean);
}

/** Return the least number of typing errors that make a beginning of `text` of `word`: 1 for two swapped letters. */
function errors(word, text) {
  let before = [];
  let last = Array.from({ length: text.length + 1 }, (_, column) => column);
  for (let row = 1; row <= word.length; row += 1) {
    const next = [row];
    for (let column = 1; column <= text.length; column += 1) {
      const same = word[row - 1] === text[column - 1] ? 0 : 1;
      next.push(Math.min(last[column] + 1, next[column - 1] + 1, last[column - 1] + same));
      const isSwapped = row > 1 && column > 1 && word[row - 1] === text[column - 2] && word[row - 2] === text[column - 1];
      if (isSwapped) next[column] = Math.min(next[column], before[column - 2] + 1);
    }
    [before, last] = [last, next];
  }
  return Math.min(...last);
}

/** Return the errors in a word that are forgiven: none in a short one. */
function forgiven(word) {
  return word.length < 4 ? 0 : word.length < 8 ? 1 : 2;
}

/** Return the typing errors of the best match of `word` among the beginnings of `texts`, and Infinity for no match. */
function nearest(word, texts, isForgiving) {
  if (texts.some((text) => text.startsWith(word))) return 0;
  if (!isForgiving || !forgiven(word)) return Infinity;
  const least = Math.min(...texts.map((text) => errors(word, text)));
  return least <= forgiven(word) ? least : Infinity;
}

/**
 * Return the entries in whose names all words of a query are the beginning of a word, the best first:
 * `nav_state offb` finds NAVIGATION_STATE_OFFBOARD. With `isForgiving`, words may have typing errors.
 */
function searchWords(index, query, isForgiving) {
  const words = wordsOf(query);
  const found = [];
  if (!words.length) return found;
  for (const [kind, name, url, text, anchors] of index) {
    const page = [...wordsOf(name), wordsOf(name).join("")];
    const own = words.map((word) => nearest(word, page, isForgiving));
    const score = own.reduce((sum, each) => sum + each, 0);
    if (score < Infinity) {
      found.push({ score, name, url, text: `${KINDS[kind]}${text && `: ${text}`}` });
      continue;
    }
    for (const anchor of anchors) {
      const inner = [...wordsOf(anchor), wordsOf(anchor).join("")];
      let sum = 0.5;
      for (let at = 0; at < words.length && sum < Infinity; at += 1) {
        sum += Math.min(own[at], nearest(words[at], inner, isForgiving));
      }
      if (sum < Infinity) found.push({ score: sum, name: anchor, url: `${url}#${anchor}`, text: `in ${name}` });
    }
  }
  return best(found);
}

/** Return the entries for a query: those with its exact words, or else parts of names, or else similar names. */
function search(index, query) {
  for (const find of [searchExact, searchWords, (...words) => searchWords(...words, true)]) {
    const found = find(index, query);
    if (found.length) return found;
  }
  return [];
}

/** Return the best of the entries, which have a low score and a short name. */
function best(found) {
  return found.sort((a, b) => a.score - b.score || a.name.length - b.name.length).slice(0, MOST);
}

/** Return the entries that have the words of a query, the best first. An anchor may match words of its page too. */
function searchExact(index, query) {
  const words = query.toLowerCase().split(/\s+/).filter(Boolean);
  const joined = words.map((word) => word.replaceAll("_", "") || word); // vehicle_status finds VehicleStatus
  const found = [];
  if (!words.length) return found;
  for (const [kind, name, url, text, anchors] of index) {
    const exact = rankAll(name, words);
    const own = exact < 0 ? rankAll(name, joined) : exact;
    if (own >= 0) found.push({ score: own, name, url, text: `${KINDS[kind]}${text && `: ${text}`}` });
    else if (text && rankAll(text, words) >= 0) found.push({ score: 6, name, url, text: `${KINDS[kind]}: ${text}` });
    for (const anchor of anchors) {
      const whole = `${name}.${anchor}`;
      const rest = words.filter((word) => rank(anchor, word) < 0);
      if (rest.length === words.length || rankAll(whole, rest) < 0) continue;
      const inner = rankAll(anchor, words.filter((word) => !rest.includes(word)));
      found.push({ score: inner + 0.5, name: anchor, url: `${url}#${anchor}`, text: `in ${name}` });
    }
  }
  return best(found);
}

/** Prepare the filter of the page of changes, and open the changes that the address names. */
function prepareChanges() {
  const changed = [...document.querySelectorAll("details.changed")];
  const box = document.getElementById("filter-box");
  if (!box) return;
  const texts = changed.map((each) => each.textContent.toLowerCase());
  const count = document.getElementById("filter-count");

  function filter() {
    const words = box.value.toLowerCase().split(/\s+/).filter(Boolean);
    changed.forEach((each, at) => { each.hidden = !words.every((word) => texts[at].includes(word)); });
    for (const section of document.querySelectorAll("main section")) {
      section.hidden = !section.querySelector("details.changed:not([hidden])");
    }
    count.value = words.length ? `${changed.filter((each) => !each.hidden).length} of ${changed.length}` : "";
  }

  function openTarget() {
    const target = changed.find((each) => each.id === decodeURIComponent(location.hash.slice(1)));
    if (target) target.open = true;
  }

  document.getElementById("filter").hidden = false;
  document.getElementById("filter-open").addEventListener("click", () => { for (const each of changed) each.open = true; });
  box.addEventListener("input", filter);
  addEventListener("hashchange", openTarget);
  openTarget();
}

document.addEventListener("DOMContentLoaded", prepareChanges);
document.addEventListener("DOMContentLoaded", () => {
  const root = document.body.dataset.root;
  const box = document.getElementById("search-box");
  const list = document.getElementById("search-results");
  const button = document.getElementById("theme-button");
  let chosen = -1;

  button.addEventListener("click", () => {
    const system = matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
    const theme = (document.documentElement.dataset.theme || system) === "dark" ? "light" : "dark";
    document.documentElement.dataset.theme = theme;
    remembered.theme = theme;
  });

  function load() {
    if (document.getElementById("search-index")) return;
    const script = document.createElement("script");
    script.id = "search-index";
    script.src = `${root}search.js`;
    script.addEventListener("load", show);
    document.head.append(script);
  }

  function choose(number) {
    const options = list.querySelectorAll("[role=option]");
    if (chosen >= 0) options[chosen].setAttribute("aria-selected", "false");
    chosen = options.length ? (number + options.length) % options.length : -1;
    if (chosen < 0) return;
    options[chosen].setAttribute("aria-selected", "true");
    options[chosen].scrollIntoView({ block: "nearest" });
    box.setAttribute("aria-activedescendant", options[chosen].id);
  }

  function hide() {
    list.hidden = true;
    box.setAttribute("aria-expanded", "false");
    box.removeAttribute("aria-activedescendant");
  }

  function show() {
    const query = box.value.trim();
    if (!window.msggenIndex || !query) return hide();
    const found = search(window.msggenIndex, query);
    chosen = -1;
    list.replaceChildren(...found.map((each, number) => {
      const item = document.createElement("li");
      const link = document.createElement("a");
      const about = document.createElement("small");
      item.id = `search-result-${number}`;
      item.setAttribute("role", "option");
      item.setAttribute("aria-selected", "false");
      link.href = root + each.url;
      link.tabIndex = -1;
      about.textContent = each.text;
      link.append(each.name, about);
      item.append(link);
      return item;
    }));
    if (!found.length) {
      const none = document.createElement("li");
      none.className = "none";
      none.textContent = "nothing found";
      list.append(none);
    }
    list.hidden = false;
    box.setAttribute("aria-expanded", "true");
    choose(0);
  }

  box.addEventListener("focus", load);
  box.addEventListener("input", show);
  box.addEventListener("keydown", (event) => {
    if (event.key === "ArrowDown") choose(chosen + 1);
    else if (event.key === "ArrowUp") choose(chosen - 1);
    else if (event.key === "Escape") hide();
    else if (event.key === "Enter" && chosen >= 0 && !list.hidden) {
      list.querySelectorAll("[role=option] a")[chosen].click();
      hide();
    } else return;
    event.preventDefault();
  });
  list.addEventListener("click", hide);
  document.addEventListener("click", (event) => { if (!event.target.closest(".search")) hide(); });
  document.addEventListener("keydown", (event) => {
    const isTyping = event.target.closest("input, textarea, select");
    if (event.key !== "/" || isTyping || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    box.focus();
    box.select();
  });
});
