// Long texts.

/** Text in pieces: one string of a million lines would be copied at every line. */
export class Lines {
  private readonly pieces: string[] = [];
  private open: string[] = [];

  add(line: string) {
    if (this.open.push(line) < 10_000) return;
    this.pieces.push(`${this.open.join("\n")}\n`);
    this.open = [];
  }

  blob(type: string): Blob {
    const rest = this.open.length ? [`${this.open.join("\n")}\n`] : [];
    return new Blob([...this.pieces, ...rest], { type });
  }
}

/** The shortest decimal number that single precision reads as the same. */
export function shortest(value: number): string {
  if (!Number.isFinite(value)) return String(value);
  for (let digits = 6; digits < 9; digits++) {
    const text = value.toPrecision(digits);
    if (Math.fround(Number(text)) === Math.fround(value)) return String(Number(text));
  }
  return String(Number(value.toPrecision(9)));
}
