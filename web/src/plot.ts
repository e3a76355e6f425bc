// Plots on a canvas: sharp on any screen, in the colours of the page.

export interface Frame {
  context: CanvasRenderingContext2D;
  width: number;
  height: number;
  ink: string;
  faint: string;
  accent: string;
  second: string;
  /** A text that stays readable on whatever is drawn under it. */
  write: (text: string, x: number, y: number) => void;
}

/** A canvas that is drawn again when its size or the theme changes. */
export class Plot {
  readonly canvas: HTMLCanvasElement;

  constructor(height: number, label: string, private readonly paint: (frame: Frame) => void) {
    this.canvas = document.createElement("canvas");
    this.canvas.className = "plot";
    this.canvas.style.height = `${height}px`;
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", label);
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
  }

  draw() {
    const { canvas } = this;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    const context = canvas.getContext("2d");
    if (!width || !height || !context) return;
    const ratio = window.devicePixelRatio || 1;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    context.font = "11px system-ui, sans-serif";
    context.lineWidth = 1;
    const style = getComputedStyle(canvas);
    const colour = (name: string) => style.getPropertyValue(name).trim();
    const [ink, card] = [colour("--ink"), colour("--card")];
    const write = (text: string, x: number, y: number) => {
      context.save();
      context.globalAlpha = 0.8;
      context.strokeStyle = card;
      context.lineWidth = 4;
      context.lineJoin = "round";
      context.strokeText(text, x, y);
      context.globalAlpha = 1;
      context.fillStyle = ink;
      context.fillText(text, x, y);
      context.restore();
    };
    this.paint({ context, width, height, ink, write, faint: colour("--line"), accent: colour("--accent"), second: colour("--second") });
  }

  /** The position of a pointer in CSS pixels of the plot. */
  at(event: PointerEvent | MouseEvent): [number, number] {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }
}

/** Round values that divide a range. */
export function ticks(low: number, high: number, wanted = 4): number[] {
  const raw = (high - low) / wanted;
  if (!(raw > 0) || !Number.isFinite(raw)) return [];
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = power * ([1, 2, 5, 10].find((factor) => factor * power >= raw) ?? 10);
  const found: number[] = [];
  for (let k = Math.ceil(low / step); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  return found;
}
