/**
 * Confirmation of an action by holding its button, without input or output of its own.
 *
 * The action begins when the button was held for HOLD_TIME. An earlier release, or the loss of the focus,
 * cancels it. One hold begins one action.
 */

export const HOLD_TIME = 600; // [ms]

/** Timers of the browser, or of a test. */
export interface Timers {
  start(action: () => void, time: number): number;
  cancel(timer: number): void;
}

export const browserTimers: Timers = {
  start: (action, time) => window.setTimeout(action, time),
  cancel: (timer) => window.clearTimeout(timer),
};

export class Hold<T> {
  held: T | null = null;
  private timer: number | null = null;
  private readonly act: (target: T) => void;
  private readonly changed: () => void;
  private readonly timers: Timers;

  /** `act` receives the target of a complete hold, `changed` is called after each change of `held`. */
  constructor(act: (target: T) => void, changed: () => void, timers: Timers = browserTimers) {
    this.act = act;
    this.changed = changed;
    this.timers = timers;
  }

  /** Begin to hold. A hold of another target ends without an action. */
  begin(target: T): void {
    this.end();
    this.held = target;
    this.timer = this.timers.start(() => this.complete(target), HOLD_TIME);
    this.changed();
  }

  /** End the hold, whatever the cause. */
  end(): void {
    if (this.timer !== null) this.timers.cancel(this.timer);
    this.timer = null;
    if (this.held === null) return;
    this.held = null;
    this.changed();
  }

  /** Begin the action of a target, which the user has confirmed. */
  complete(target: T): void {
    this.end();
    this.act(target);
  }
}
