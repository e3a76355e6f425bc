// The reference of the API: Swagger UI over this server's own document.

// By its address: a file of 1.6 MB that is minified already would be most of the build of the page.
import bundle from "swagger-ui-dist/swagger-ui-bundle.js?url";
import "swagger-ui-dist/swagger-ui.css";
import { key } from "../api";
import "./reference.css";
import { opsFilter } from "./search";

interface Document {
  servers: { url: string }[];
  tags: { name: string }[];
  paths: Record<string, Record<string, { operationId?: string; tags?: string[] }>>;
}

/** Links of before, to `#operationId` and `#Schema`: the first are those of Swagger UI with the tag before, the others are on the plain page. */
function keepAlive(document: Document) {
  let name = "";
  try {
    name = decodeURIComponent(location.hash.slice(1));
  } catch {
    // What is no encoding of anything is no name of anything.
  }
  if (!name || name.startsWith("/")) return;
  const operations = Object.values(document.paths).flatMap((path) => Object.values(path));
  const found = operations.find(({ operationId }) => operationId === name);
  if (found) history.replaceState(null, "", `#/${found.tags?.[0]}/${name}`);
  else location.replace(`docs/plain#${name}`);
}

/** Loads Swagger UI. */
const load = () => new Promise<void>((resolve, reject) => {
  const script = document.createElement("script");
  script.src = bundle;
  script.addEventListener("load", () => resolve());
  script.addEventListener("error", () => reject(new Error("a script of this page cannot be had")));
  document.head.append(script);
});

/** Names for what Swagger UI leaves nameless. */
function name(place: HTMLElement) {
  const search = place.querySelector(".operation-filter-input");
  search?.setAttribute("placeholder", "Search the operations");
  search?.setAttribute("aria-label", "Search the operations");
  for (const select of place.querySelectorAll("select:not([aria-label])")) select.setAttribute("aria-label", select.id === "servers" ? "Server" : "Value");
  for (const input of place.querySelectorAll("input[type=file]:not([aria-label]), textarea:not([aria-label])")) input.setAttribute("aria-label", "Body");
  for (const scrolled of place.querySelectorAll("pre:not([tabindex])")) scrolled.setAttribute("tabindex", "0");
}

async function start() {
  const place = document.getElementById("reference")!;
  const [answer] = await Promise.all([fetch("openapi.json"), load()]);
  if (!answer.ok) throw new Error(`the document cannot be had: ${answer.status}`);
  const spec = (await answer.json()) as Document;
  // Wherever this page is served, the API is beside it: behind a proxy too.
  spec.servers = [{ url: new URL(".", location.href).pathname.replace(/\/$/, "") || "/" }];
  keepAlive(spec);
  const nothing = () => () => null;
  // A link inside of the button that opens an operation could not be reached by itself; opening it writes the same address.
  const plain = (_: unknown, { React }: { React: { createElement(...parts: unknown[]): unknown } }) => ({ text }: { text: unknown }) => React.createElement("span", null, text);
  new MutationObserver(() => name(place)).observe(place, { childList: true, subtree: true });
  const shown = SwaggerUIBundle({
    spec,
    domNode: place,
    deepLinking: true,
    docExpansion: "list",
    defaultModelsExpandDepth: 0,
    filter: true,
    tryItOutEnabled: true,
    displayRequestDuration: true,
    validatorUrl: null,
    plugins: [{ fn: { opsFilter }, wrapComponents: { ServersContainer: nothing, DeepLink: plain } }],
    onComplete: () => {
      // The key that the page keeps in this tab.
      if (key.get()) shown.preauthorizeApiKey("bearer", key.get());
      document.body.dataset.ready = "true";
    },
  });
}

const dark = matchMedia("(prefers-color-scheme: dark)");
const colour = () => document.documentElement.classList.toggle("dark-mode", dark.matches);
dark.addEventListener("change", colour);
colour();
start().catch((error: unknown) => {
  document.getElementById("reference")!.textContent = `The reference cannot be shown: ${String(error)}`;
});
