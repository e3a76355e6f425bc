/**
 * Runs one request at a time for something that changes under a finger: while one runs, only the latest wish is kept.
 * So the server is never asked for more than can be shown. With `width`, so many may be under way, and whoever runs them looks to
 * their order.
 */
export function latest<T>(run: (wish: T) => Promise<void>, failed: (error: unknown) => void, width = 1): (wish: T) => void {
  let running = 0;
  let waiting: { wish: T } | null = null;
  const next = async () => {
    if (running >= width || !waiting) return;
    const { wish } = waiting;
    waiting = null;
    running += 1;
    try {
      await run(wish);
    } catch (error) {
      failed(error);
    }
    running -= 1;
    void next();
  };
  return (wish) => {
    waiting = { wish };
    void next();
  };
}
