// Jobs that this page follows: those that it submitted, and those that it found running.

import { ApiError, ended, get, post, send, watch, type Job, type Page } from "./api";

/** Streams of events at once. A browser keeps six connections to a server, and everything else needs some of them. */
const STREAMS = 2;
/** Milliseconds between two looks at what no stream tells. */
const PAUSE = 1500;
/** The same where the server did not answer. */
const LATER = 10_000;
/** Jobs of a page of the list, and pages of waiting ones that are read. */
const PAGE = 100;
const PAGES = 5;

export class Jobs {
  private readonly all = new Map<string, Job>();
  private readonly streams = new Set<string>();
  private readonly stop = new AbortController();
  private timer = 0;
  /** Whether somebody looks at the list: then what others submit is of interest too. */
  private looked = false;
  /** The newest jobs of the server, as far as they were read. */
  newest: Job[] = [];
  private next: string | null = null;
  private turn = 0;

  constructor(private readonly changed: () => void, private readonly finished: (job: Job) => Promise<void>, private readonly fail: (error: unknown) => void) {}

  /** All that are followed, newest first. */
  get list(): Job[] {
    return [...this.all.values()].sort(newer);
  }

  /** Those that have not ended. */
  get running(): Job[] {
    return this.list.filter(({ status }) => !ended(status));
  }

  /** The place of a waiting job in the queue, counted from 1, as far as others that wait are known; null for all other jobs. */
  place(job: Job): number | null {
    if (job.status !== "enqueued") return null;
    const waiting = this.running.filter(({ status }) => status === "enqueued").sort((a, b) => b.priority - a.priority || -newer(a, b));
    const at = waiting.findIndex(({ id }) => id === job.id);
    return at < 0 ? null : at + 1;
  }

  /** Takes note of a job, or of how it stands now. */
  put(job: Job) {
    const before = this.all.get(job.id);
    if (before && before.revision > job.revision) return;
    this.all.set(job.id, job);
    this.newest = this.newest.some(({ id }) => id === job.id) ? this.newest.map((other) => (other.id === job.id ? job : other)) : [job, ...this.newest].sort(newer);
    this.changed();
    if (before && !ended(before.status) && ended(job.status)) this.finished(job).catch(this.fail);
  }

  /** Forgets jobs, here and in the list. */
  forget(which: (job: Job) => boolean) {
    for (const job of [...this.all.values()]) if (which(job)) this.all.delete(job.id);
    this.newest = this.newest.filter((job) => !which(job));
    this.changed();
  }

  /** Takes a job out of sight; it stays in the list of the server. */
  dismiss(job: Job) {
    this.all.delete(job.id);
    this.changed();
  }

  /** Shows a job and its changes until it has ended. */
  follow(job: Job) {
    this.put(job);
    if (ended(job.status)) return;
    if (this.streams.has(job.id) || this.streams.size >= STREAMS) return this.soon();
    this.streams.add(job.id);
    const told = (job: Job) => {
      // One that was dismissed, or whose mesh is gone, does not come back.
      if (this.all.has(job.id)) this.put(job);
    };
    watch(job, told, this.stop.signal)
      .then(told)
      .catch((error) => this.all.has(job.id) && this.lost(job, error))
      .finally(() => {
        this.streams.delete(job.id);
        const other = this.running.find(({ id }) => !this.streams.has(id));
        if (other) this.follow(other);
      });
  }

  /** Tells why a job cannot be followed. What the server refuses, as a job that was deleted, is not asked for again and again. */
  private lost(job: Job, error: unknown) {
    if (!refused(error)) return this.fail(error);
    this.forget(({ id }) => id === job.id);
    if (error.problem.status !== 404) this.fail(error);
  }

  /** Takes up the jobs that still run, after a reload for example. */
  async resume() {
    for (const status of ["processing", "enqueued"]) {
      let from: string | null = null;
      for (let page = 0; page < PAGES; page++) {
        const found: Page<Job> = await get(`/v1/jobs?status=${status}&limit=${PAGE}${from ? `&from=${encodeURIComponent(from)}` : ""}`);
        found.items.forEach((job) => this.follow(job));
        from = found.next;
        if (!from) break;
      }
    }
  }

  /** Reads the newest jobs of the server, of a status if one is given, and goes on reading them until `look(false)`. */
  async look(on: boolean, status = "", more = false) {
    this.looked = on;
    const turn = ++this.turn;
    if (!on) return;
    const found: Page<Job> = await get(`/v1/jobs?limit=${PAGE}${status && `&status=${status}`}${more && this.next ? `&from=${encodeURIComponent(this.next)}` : ""}`);
    // Another part of the list has been asked for meanwhile.
    if (turn !== this.turn) return;
    this.next = found.next;
    const known = new Set(more ? this.newest.map(({ id }) => id) : []);
    this.newest = [...(more ? this.newest : []), ...found.items.filter(({ id }) => !known.has(id))].sort(newer);
    for (const job of found.items) if (!ended(job.status) || this.all.has(job.id)) this.follow(job);
    this.changed();
    this.soon();
  }

  /** Whether the server has older ones than were read. */
  get more(): boolean {
    return this.next !== null;
  }

  private soon(pause = PAUSE) {
    if (this.timer) return;
    this.timer = window.setTimeout(() => {
      this.timer = 0;
      this.glance().catch((error) => {
        this.fail(error);
        // A server that was started anew answers again.
        if (!refused(error)) this.soon(LATER);
      });
    }, pause);
  }

  /** Looks at what no stream tells. */
  private async glance() {
    const silent = () => this.running.filter(({ id }) => !this.streams.has(id));
    if (!this.looked && silent().length === 0) return;
    if (!document.hidden) {
      const { items } = await get<Page<Job>>(`/v1/jobs?limit=${PAGE}`);
      for (const job of items) if (this.all.has(job.id) || (this.looked && !ended(job.status))) this.follow(job);
      const old = silent().find(({ id }) => !items.some((item) => item.id === id));
      if (old) await this.again(old);
    }
    this.soon();
  }

  /** Asks for a job that the newest do not hold; one that was deleted is forgotten. */
  private async again(job: Job) {
    try {
      this.put(await get<Job>(job.links.self));
    } catch (error) {
      if (!refused(error) || error.problem.status !== 404) throw error;
      this.forget(({ id }) => id === job.id);
    }
  }

  readonly cancel = (job: Job) => post<Job>(`/v1/jobs/${job.id}/cancel`).then((job) => this.put(job)).catch(this.fail);

  readonly retry = (job: Job) => post<Job>(`/v1/jobs/${job.id}/retry`).then((job) => this.follow(job)).catch(this.fail);

  /** Deletes a job that has ended, and the basis that it made. */
  readonly remove = (job: Job) => send(`/v1/jobs/${job.id}?cascade=true`, { method: "DELETE" }).then(() => this.forget(({ id }) => id === job.id));
}

/** Whether the server understood what was asked, and said no. */
const refused = (error: unknown): error is ApiError => error instanceof ApiError && (error.problem.status ?? 500) < 500;

/** Newest first. */
const newer = (a: Job, b: Job) => b.created_ms - a.created_ms || (a.id < b.id ? 1 : -1);
