// Typing errors in a search: a word that no page has becomes the nearest word of the pages, and the page says so.
"use strict";

/** Return the least number of typing errors between two words: 1 for two swapped letters. */
function typingErrors(one, other) {
  let before = [];
  let last = Array.from({ length: other.length + 1 }, (_, column) => column);
  for (let row = 1; row <= one.length; row += 1) {
    const next = [row];
    for (let column = 1; column <= other.length; column += 1) {
      const same = one[row - 1] === other[column - 1] ? 0 : 1;
      next.push(Math.min(last[column] + 1, next[column - 1] + 1, last[column - 1] + same));
      const isSwapped = row > 1 && column > 1 && one[row - 1] === other[column - 2] && one[row - 2] === other[column - 1];
      if (isSwapped) next[column] = Math.min(next[column], before[column - 2] + 1);
    }
    [before, last] = [last, next];
  }
  return last[other.length];
}

/** Return the nearest of `words`, or `word` itself if they have it as a part, or have nothing near. */
function nearestWord(word, words) {
  const wanted = word.toLowerCase();
  if (wanted.length < 4 || words.some((each) => each.includes(wanted))) return word;
  let found = word;
  let least = wanted.length < 8 ? 2 : 3; // one error is forgiven in a word of four letters, two in one of eight
  for (const each of words) {
    if (Math.abs(each.length - wanted.length) >= least) continue;
    const errors = typingErrors(wanted, each);
    if (errors < least) [found, least] = [each, errors];
  }
  return found;
}

function loadWords() {
  return new Promise((resolve) => {
    const script = document.createElement("script");
    script.src = `${document.documentElement.dataset.content_root}_static/words.js`;
    script.addEventListener("load", () => resolve(window.msggenWords.split(" ")));
    script.addEventListener("error", () => resolve([]));
    document.head.append(script);
  });
}

function forgive() {
  const exact = Search.query;
  Search.query = async (query) => {
    const words = await loadWords();
    const corrected = query.replace(/[A-Za-z_]\w*/g, (word) => nearestWord(word, words));
    if (corrected !== query) {
      const note = document.createElement("p");
      note.className = "search-note";
      note.textContent = `No page has “${query}”. These have “${corrected}”.`;
      document.getElementById("search-results").prepend(note);
    }
    exact(corrected);
  };
}

document.addEventListener("DOMContentLoaded", () => { if (typeof Search !== "undefined") forgive(); });
