/** Motion of one axis while a control is held, with a record of its signals at the full cycle rate. */

import { signal } from "@preact/signals";
import type { Connection, JogRequest } from "../connection.ts";
import { KIND_FULL } from "../protocol.ts";
import { RingStore } from "../scope/store.ts";
import { Jogging } from "../views/axes/jogging.ts";

const BEFORE = 100; // [ms] of record before the motion
const AFTER = 1000; // [ms] of record after its end

/** Owns the record and the jog of a test. */
export class MotionTest {
  readonly held = signal(0); // number of the held control; 0: none
  readonly store = signal<RingStore | null>(null); // of the last test
  readonly jogging: Jogging;
  private moving = false;
  private record: (() => void) | null = null;
  private timer: ReturnType<typeof setTimeout> | undefined;

  constructor(
    private readonly connection: Connection,
    readonly axis: number,
    private readonly names: readonly string[],
  ) {
    this.jogging = new Jogging(connection);
  }

  /** Watch for causes of a release. Return a function that ends the test. */
  attach(): () => void {
    const detach = this.jogging.attach();
    const unsubscribe = this.jogging.held.subscribe((held) => {
      if (held === null && this.moving) this.end();
    });
    return () => {
      unsubscribe();
      detach();
      this.finish();
    };
  }

  /** Record up to `seconds`, and move until `end` or until the motion is complete. */
  begin(control: number, seconds: number, jog: JogRequest): void {
    this.finish();
    this.held.value = control;
    this.jogging.forget(this.axis);
    this.record = this.start(seconds);
    const releases = this.jogging.releases; // a release in the meantime also cancels this press
    this.timer = setTimeout(() => {
      if (this.jogging.releases !== releases) return this.end();
      this.jogging.press(this.axis, jog.velocity < 0 ? -1 : 1, jog, false);
      this.moving = this.jogging.held.peek() !== null;
      if (!this.moving) this.end();
    }, BEFORE);
  }

  /** Release the axis, and finish the record a second later. */
  end(): void {
    if (this.held.peek() === 0) return;
    this.held.value = 0;
    this.moving = false;
    this.jogging.release();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.finish(), AFTER);
  }

  private finish(): void {
    clearTimeout(this.timer);
    this.record?.();
    this.record = null;
  }

  /** Record the signals. Return a function that ends the record. */
  private start(seconds: number): () => void {
    const names = [...this.names];
    const store = new RingStore(seconds, this.connection.hello.peek()!.layout.period);
    for (const name of names) store.add(name);
    const end = this.connection.subscribe(names, { full: true, rate: 60 }, (frame) => {
      if (frame.kind !== KIND_FULL) return;
      store.append({ time: frame.time, names, values: frame.columns, lost: frame.lost });
    });
    return () => {
      end();
      if (store.end > 1) this.store.value = store;
    };
  }
}
