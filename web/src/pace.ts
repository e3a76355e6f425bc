// How much is drawn while things move: as many pixels and triangles as the machine can do in time.

/** Milliseconds between two pictures above which less is drawn, and below which more. */
const SLOW = 33;
const FAST = 19;

export interface Rung {
  /** Which level of the mesh. */
  level: number;
  /** Pixels along an edge, as a part of those of the screen. */
  scale: number;
}

/** A ladder from the whole mesh with all pixels down to its coarsest level with few, and where on it one stands. */
export class Pace {
  private rungs: Rung[] = [{ level: 0, scale: 1 }];
  private at = 0;
  private mean = 0;
  private counted = 0;
  /** Fast pictures before a rung is tried again: twice as many each time that it turns out too slow. */
  private patience: number[] = [];

  /** Begins anew for a mesh whose levels have so many triangles; `few` is what may be drawn without having been tried. */
  begin(triangles: number[], few: number) {
    this.rungs = triangles.flatMap((_, level) => (level === 0 ? [1, 0.8, 0.65, 0.5] : [0.8, 0.65, 0.5]).map((scale) => ({ level, scale })));
    this.rungs.push({ level: triangles.length - 1, scale: 0.35 });
    const level = triangles.findIndex((count) => count <= few);
    this.at = this.rungs.findIndex((rung) => rung.level === (level < 0 ? triangles.length - 1 : level));
    this.patience = this.rungs.map(() => 30);
    this.rest();
  }

  /** Stays with the whole mesh and all pixels: for whoever measures. */
  hold() {
    this.rungs = [{ level: 0, scale: 1 }];
    this.at = 0;
  }

  get rung(): Rung {
    return this.rungs[this.at];
  }

  /** Nothing moves any more: what follows is measured afresh. */
  rest() {
    this.counted = -3;
    this.mean = (SLOW + FAST) / 2;
  }

  /** Notes the milliseconds between two pictures that followed each other as fast as they could. */
  note(interval: number) {
    this.counted += 1;
    // The first ones after a change are of no use: buffers are made and shaders compiled.
    if (this.counted < 0) return;
    this.mean += 0.2 * (interval - this.mean);
    if (this.counted >= 4 && this.mean > SLOW && this.at + 1 < this.rungs.length) {
      this.patience[this.at] = Math.min(2 * this.patience[this.at], 2000);
      this.at += 1;
      this.rest();
    } else if (this.at > 0 && this.counted >= this.patience[this.at - 1] && this.mean < FAST) {
      this.at -= 1;
      this.rest();
    }
  }
}
