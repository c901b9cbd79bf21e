// One request at a time; of those that come meanwhile only the last one counts.

// A request that takes longer is given up for the next one.
const PATIENCE_MS = 400;

export class Latest {
  // `send` gets a signal and returns a promise; what is asked for meanwhile is sent afterwards.
  constructor(send) {
    this.send = send;
    this.running = null;
    this.isWanted = false;
  }

  ask() {
    if (!this.running) {
      this.run();
      return;
    }
    this.isWanted = true;
    if (performance.now() - this.since > PATIENCE_MS) this.running.abort();
  }

  // Gives up what runs; the server hears of it.
  cancel() {
    this.isWanted = false;
    this.running?.abort();
  }

  async run() {
    this.running = new AbortController();
    [this.since, this.isWanted] = [performance.now(), false];
    const { signal } = this.running;
    try {
      await this.send(signal);
    } finally {
      this.running = null;
      if (this.isWanted) this.run();
    }
  }
}
