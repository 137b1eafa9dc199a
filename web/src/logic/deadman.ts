/**
 * Dead-man control of one jog, without input or output of its own.
 *
 * A jog begins with `press`. Each token that arrives while it is held is echoed once. The jog ends with
 * `release`, with an answer that it no longer moves, and when tokens stay away for TOKEN_LIFE. A new
 * motion always requires a new press.
 */

import type { JogRequest } from "../connection.ts";

export const TOKEN_LIFE = 200; // [ms]; the loop accepts no older token

/** Receiver of the messages of a dead-man control. */
export interface DeadmanOutput {
  press(axis: number, jog: JogRequest, token: string): number | null;
  beat(axis: number, press: number, token: string): void;
  release(axis: number, press: number): void;
}

export interface Held {
  axis: number;
  press: number;
}

export type Refusal = "busy" | "no_token" | "no_connection" | "not_enabled";

/** Statuses of a jog that still moves. */
const MOVING = new Set(["NONE", "MOVING"]);

export class Deadman {
  held: Held | null = null;
  private token: string | null = null;
  private tokenTime = -Infinity;
  private enabling = false;
  private readonly output: DeadmanOutput;
  private readonly now: () => number;

  /** `now` returns a monotonic time [ms]. */
  constructor(output: DeadmanOutput, now: () => number) {
    this.output = output;
    this.now = now;
  }

  /** Begin a jog. Return the reason of a refusal, or null. `touch`: an enabling touch is required. */
  press(axis: number, jog: JogRequest, { touch = false } = {}): Refusal | null {
    if (this.held !== null) return "busy";
    if (touch && !this.enabling) return "not_enabled";
    if (this.token === null || this.isStale()) return "no_token";
    const press = this.output.press(axis, jog, this.token);
    if (press === null) return "no_connection";
    this.held = { axis, press };
    return null;
  }

  /** Receive a token of the loop. */
  receiveToken(token: string): void {
    const missed = this.isStale();
    this.token = token;
    this.tokenTime = this.now();
    if (this.held === null) return;
    if (missed) this.release();
    else this.output.beat(this.held.axis, this.held.press, token);
  }

  /** Set the enabling touch. Its end releases the jog. */
  enable(on: boolean): void {
    this.enabling = on;
    if (!on) this.release();
  }

  /** Release the jog, whatever the cause. */
  release(): void {
    const held = this.held;
    this.held = null;
    if (held !== null) this.output.release(held.axis, held.press);
  }

  /** Receive the status of a jog. A jog that no longer moves ends without a release. */
  receiveStatus(press: number, status: string): void {
    if (this.held?.press === press && !MOVING.has(status)) this.held = null;
  }

  /** The connection is lost: no later message may continue the jog, and the enabling touch must be renewed. */
  disconnect(): void {
    this.held = null;
    this.enabling = false;
    this.token = null;
    this.tokenTime = -Infinity;
  }

  private isStale(): boolean {
    return this.now() - this.tokenTime > TOKEN_LIFE;
  }
}
