/**
 * Runs one request at a time for something that changes under a finger: while one runs, only the latest wish is kept.
 * So the server is never asked for more than can be shown.
 */
export function latest<T>(run: (wish: T) => Promise<void>, failed: (error: unknown) => void): (wish: T) => void {
  let running = false;
  let waiting: { wish: T } | null = null;
  const next = async () => {
    if (running || !waiting) return;
    const { wish } = waiting;
    waiting = null;
    running = true;
    try {
      await run(wish);
    } catch (error) {
      failed(error);
    }
    running = false;
    void next();
  };
  return (wish) => {
    waiting = { wish };
    void next();
  };
}
