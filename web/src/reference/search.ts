// Which operations a search leaves: those in whose path, name, summary and description every word stands. Swagger UI's own filter knows
// tags and paths alone.

/** What is used of Immutable's collections, in which Swagger UI keeps its state. */
interface Collection {
  get(name: string): unknown;
  getIn(path: string[]): unknown;
  filter(keep: (value: Collection, key: string) => boolean): Collection;
  map(change: (value: Collection, key: string) => Collection): Collection;
  set(name: string, value: unknown): Collection;
  size: number;
}

const text = (value: unknown) => (typeof value === "string" ? value : "");

/** The operations, by tag, that a search leaves. */
export function opsFilter(tags: Collection, wish: string): Collection {
  const words = wish.toLowerCase().split(/\s+/).filter(Boolean);
  const kept = tags.map((tag, name) => {
    const all = tag.get("operations") as Collection;
    const some = all.filter((operation) => {
      const inner = operation.get("operation") as Collection;
      const parts = [name, operation.get("method"), operation.get("path"), ...["operationId", "summary", "description"].map((part) => inner.get(part))];
      const whole = parts.map(text).join(" ").toLowerCase();
      return words.every((word) => whole.includes(word));
    });
    return tag.set("operations", some);
  });
  return kept.filter((tag) => (tag.get("operations") as Collection).size > 0);
}
