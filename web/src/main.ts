// Puts the page together.

import { key } from "./api";
import { App } from "./app";
import { codeFoot } from "./copy";
import { h } from "./dom";
import { library } from "./library";
import { Look } from "./panels/look";
import { familyPanel } from "./panels/family";
import { fieldsPanel } from "./panels/fields";
import { filterPanel } from "./panels/filter";
import { mapsPanel } from "./panels/maps";
import { modesPanel } from "./panels/modes";
import { pointsPanel } from "./panels/points";
import { shapesPanel } from "./panels/shapes";
import { vibrationPanel } from "./panels/vibration";
import { queue } from "./queue";
import { toolbar } from "./stage";
import { Viewer } from "./viewer";
import { welcome } from "./welcome";

const hints = h("p", { class: "keys", id: "keys", "aria-hidden": "true" });
const spoken = h("p", { class: "visually-hidden", "aria-live": "polite" });
const canvas = h("canvas", { class: "surface", tabIndex: 0, role: "application", "aria-label": "The surface", "aria-describedby": "keys" });
const stage = h("main", { class: "stage" }, h("div", { class: "pane" }, canvas, hints, spoken));
document.body.append(stage);

let viewer: Viewer | null = null;
try {
  viewer = new Viewer(canvas);
} catch {
  stage.append(h("p", { class: "sorry" }, "This page draws with WebGL 2, which this browser does not offer. The API under ", h("a", { href: "docs" }, "/docs"), " needs no browser."));
}
if (viewer) start(viewer);

function start(viewer: Viewer) {
  const app = new App(viewer);
  viewer.onKeys = (hint) => (hints.textContent = hint);
  viewer.cursor.tell = (text) => (spoken.textContent = text);
  const look = new Look(app);
  app.panels.push(modesPanel(app, look), filterPanel(app, look), pointsPanel(app, look), fieldsPanel(app, look), familyPanel(app, look), vibrationPanel(app, look), shapesPanel(app, look), mapsPanel(app, look, stage));

  const tabs = h("div", { class: "tabs", role: "tablist", "aria-label": "What to do" });
  app.panels.forEach((panel) => {
    panel.element.id = `panel-${panel.id}`;
    panel.element.setAttribute("role", "tabpanel");
    panel.element.setAttribute("aria-labelledby", `tab-${panel.id}`);
    panel.element.hidden = true;
    panel.element.prepend(h("p", { class: "dim about" }, panel.about, " ", h("a", { href: `docs/guide/${panel.guide}`, target: "_blank", "aria-label": `${panel.title} in the manual` }, "Manual")));
    panel.element.append(codeFoot(app, panel));
    tabs.append(h("button", { role: "tab", id: `tab-${panel.id}`, "aria-controls": `panel-${panel.id}`, onclick: () => app.tab(panel.id) }, panel.title));
  });
  const showTabs = () => {
    app.panels.forEach((panel, index) => {
      const tab = tabs.children[index] as HTMLElement;
      const here = panel === app.panel;
      tab.setAttribute("aria-selected", String(here));
      tab.tabIndex = here ? 0 : -1;
    });
  };
  app.on("tab", showTabs);
  tabs.addEventListener("keydown", (event) => {
    const step = event.key === "ArrowRight" ? 1 : event.key === "ArrowLeft" ? -1 : 0;
    if (!step) return;
    const next = (app.panels.indexOf(app.panel!) + step + app.panels.length) % app.panels.length;
    app.tab(app.panels[next].id);
    (tabs.children[next] as HTMLElement).focus();
  });

  const secret = h("input", { type: "password", autocomplete: "off", placeholder: "secret of an API key", "aria-label": "API key" });
  secret.value = key.get();
  const keys = h("details", { class: "key" }, h("summary", {}, "Key"),
    h("form", { class: "row", onsubmit: (event: Event) => {
      event.preventDefault();
      key.set(secret.value.trim());
      app.toasts.replaceChildren();
      keys.open = false;
      void begin();
    } }, secret, h("button", {}, "Use")));
  const jobs = queue(app);
  const header = h("header", {}, h("h1", {}, "Chladni"), h("span", { class: "subtitle" }, "the eigenfunctions of surfaces"),
    h("nav", {}, jobs.button, h("a", { href: "docs/guide/", target: "_blank" }, "Manual"), h("a", { href: "docs", target: "_blank" }, "API"), keys));

  stage.append(app.title, toolbar(app, look), look.legend, app.busy, welcome(app));
  document.body.prepend(header, library(app));
  document.body.append(h("section", { class: "work", "aria-label": "Tools" }, tabs, ...app.panels.map((panel) => panel.element)), jobs.dialog, app.toasts);

  async function begin() {
    try {
      await app.list();
      await Promise.all([app.arrive(), app.jobs.resume()]);
    } catch (error) {
      app.fail(error);
    }
    document.body.dataset.ready = "true";
  }
  showTabs();
  void begin();
  // For tests and for whoever looks from the console.
  Object.assign(window, { chladni: { app, viewer } });
}
