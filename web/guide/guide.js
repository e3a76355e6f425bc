// @ts-check
// The manual's search, copying of code, and the list of pages on a phone. Everything can be read without.

/** @typedef {[page: string, title: string, anchor: string, heading: string, text: string]} Section */

const root = document.body.dataset.root ?? "./";
/** @type {Promise<Section[]> | undefined} */
let index;
const load = () => (index ??= fetch(`${root}search.json`).then((answer) => (answer.ok ? answer.json() : Promise.reject(new Error(answer.statusText)))));

/** Words as they are compared: without case and accents. @param {string} text */
const plain = (text) => text.normalize("NFD").replace(/\p{M}/gu, "").toLowerCase();

/** @param {string} text @param {string} word */
function weight(text, word) {
  const at = text.indexOf(word);
  if (at < 0) return 0;
  const begins = at === 0 || !/[\p{L}\p{N}]/u.test(text[at - 1]);
  // More of the same word says a little more.
  return (begins ? 2 : 1) + Math.log2(text.split(word).length - 1);
}

/**
 * Sections in which every word is found; words of titles and headings count more than those of the text.
 * @param {Section[]} sections @param {string} wish
 */
function search(sections, wish) {
  const words = plain(wish).split(/\s+/).filter(Boolean);
  if (words.length === 0) return [];
  const found = [];
  for (const section of sections) {
    const [title, heading, text] = [plain(section[1]), plain(section[3]), plain(section[4])];
    let score = 0;
    const all = words.every((word) => {
      const [a, b, c] = [weight(title, word), weight(heading, word), weight(text, word)];
      score += (section[2] ? 3 : 6) * a + 6 * b + c;
      return a + b + c > 0;
    });
    const phrase = words.join(" ");
    if (words.length > 1 && `${heading} ${text}`.includes(phrase)) score += 3;
    // Of pages that are as good, those for users come before the reasons behind them, and before lists of pages and of figures.
    if (/^(decisions\/|benchmarks$|$)/.test(section[0])) score -= 6;
    if (all) found.push({ section, score });
  }
  return found.sort((a, b) => b.score - a.score).slice(0, 12).map(({ section }) => section);
}

/**
 * A piece of text around the first word, with the words marked.
 * @param {string} text @param {string[]} words
 */
function excerpt(text, words) {
  const element = document.createElement("small");
  const lower = text.toLowerCase();
  const first = Math.max(0, Math.min(...words.map((word) => lower.indexOf(word)).filter((at) => at >= 0), text.length));
  const begin = first === text.length ? 0 : Math.max(0, lower.lastIndexOf(" ", Math.max(0, first - 50)));
  const piece = text.slice(begin, begin + 150);
  const pattern = new RegExp(`(${words.map((word) => word.replace(/[\\^$.*+?()[\]{}|/]/g, "\\$&")).join("|")})`, "giu");
  element.append(begin > 0 ? "…" : "");
  piece.split(pattern).forEach((part, i) => {
    if (i % 2 === 0) return element.append(part);
    const mark = document.createElement("mark");
    mark.textContent = part;
    element.append(mark);
  });
  element.append(begin + 150 < text.length ? "…" : "");
  return element;
}

/** @param {HTMLElement} place */
function searchBox(place) {
  const input = document.createElement("input");
  const list = document.createElement("ul");
  const said = document.createElement("p");
  Object.assign(input, { type: "search", placeholder: "Search the manual ( / )", autocomplete: "off", spellcheck: false });
  for (const [name, value] of Object.entries({ role: "combobox", "aria-label": "Search the manual", "aria-expanded": "false", "aria-controls": "found", "aria-autocomplete": "list" })) input.setAttribute(name, value);
  list.id = "found";
  list.className = "found";
  list.hidden = true;
  list.setAttribute("role", "listbox");
  list.setAttribute("aria-label", "Found");
  said.className = "visually-hidden";
  said.setAttribute("aria-live", "polite");
  place.append(input, list, said);
  place.hidden = false;

  let chosen = -1;
  let asked = 0;
  const items = () => /** @type {HTMLElement[]} */ ([...list.querySelectorAll("[role=option]")]);
  const choose = (/** @type {number} */ next) => {
    chosen = next;
    items().forEach((item, i) => item.setAttribute("aria-selected", String(i === chosen)));
    const item = items()[chosen];
    if (item) input.setAttribute("aria-activedescendant", item.id);
    else input.removeAttribute("aria-activedescendant");
    item?.scrollIntoView({ block: "nearest" });
  };
  const close = () => {
    list.hidden = true;
    input.setAttribute("aria-expanded", "false");
    choose(-1);
  };
  const show = async () => {
    const wish = input.value.trim();
    const mine = ++asked;
    if (!wish) return close();
    const words = wish.toLowerCase().split(/\s+/);
    /** @type {Section[]} */
    let sections;
    try {
      sections = search(await load(), wish);
    } catch {
      index = undefined;
      said.textContent = "The index of the manual could not be loaded.";
      return;
    }
    if (mine !== asked) return;
    list.replaceChildren(...sections.map(([page, title, anchor, heading, text], i) => {
      const item = document.createElement("li");
      item.id = `found-${i}`;
      item.setAttribute("role", "option");
      item.dataset.address = `${root}${page}${anchor ? `#${anchor}` : ""}`;
      const name = document.createElement("strong");
      name.textContent = heading ? `${title} › ${heading}` : title;
      item.append(name, excerpt(text, words));
      item.addEventListener("click", () => go(item));
      return item;
    }));
    if (sections.length === 0) {
      const none = document.createElement("li");
      none.className = "none";
      none.setAttribute("role", "option");
      none.setAttribute("aria-disabled", "true");
      none.textContent = "Nothing has all of these words.";
      list.append(none);
    }
    said.textContent = `${sections.length} found`;
    list.hidden = false;
    input.setAttribute("aria-expanded", "true");
    choose(sections.length > 0 ? 0 : -1);
  };
  const go = (/** @type {HTMLElement | undefined} */ item) => {
    if (!item?.dataset.address) return;
    close();
    location.href = item.dataset.address;
  };
  input.addEventListener("focus", () => void load().catch(() => (index = undefined)));
  input.addEventListener("input", () => void show());
  input.addEventListener("keydown", (event) => {
    const count = items().length;
    if (event.key === "ArrowDown" && count > 0) choose((chosen + 1) % count);
    else if (event.key === "ArrowUp" && count > 0) choose((chosen + count - 1) % count);
    else if (event.key === "Enter") go(items()[chosen]);
    else if (event.key === "Escape" && !list.hidden) close();
    else return;
    event.preventDefault();
  });
  place.addEventListener("focusout", (event) => {
    if (!place.contains(/** @type {Node | null} */ (event.relatedTarget))) close();
  });
  // A click on a result must not take the focus away first.
  list.addEventListener("mousedown", (event) => event.preventDefault());
  document.addEventListener("keydown", (event) => {
    const typing = event.target instanceof HTMLElement && event.target.matches("input, textarea, select");
    if (event.key !== "/" || typing || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    input.focus();
  });
}

/** A button that copies a block of code. @param {HTMLElement} block */
function copying(block) {
  const button = document.createElement("button");
  button.textContent = "Copy";
  button.addEventListener("click", async () => {
    await navigator.clipboard.writeText(block.querySelector("code")?.textContent ?? "");
    button.textContent = "Copied";
    setTimeout(() => (button.textContent = "Copy"), 1500);
  });
  block.append(button);
}

const place = document.querySelector(".search");
if (place instanceof HTMLElement) searchBox(place);
// Without https, other than on this machine, browsers offer no clipboard.
if (navigator.clipboard) for (const block of document.querySelectorAll(".code")) if (block instanceof HTMLElement) copying(block);

const side = document.querySelector(".side");
const narrow = matchMedia("(max-width: 52rem)");
const fold = () => side instanceof HTMLDetailsElement && (side.open = !narrow.matches);
narrow.addEventListener("change", fold);
fold();
document.body.dataset.ready = "true";
