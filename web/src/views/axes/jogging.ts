/** Jogs of the page: one dead-man control, and every cause that ends its jog. */

import { batch, signal } from "@preact/signals";
import type { Connection, JogRequest } from "../../connection.ts";
import { Deadman } from "../../logic/deadman.ts";
import { asking } from "../../parts/confirm.tsx";
import type { JogMessage } from "../../protocol.ts";
import type { AxisInfo } from "../../remote.ts";
import { text } from "../../strings.ts";

export type Unit = "rad" | "m";
export type StepSize = "hold" | "small" | "medium" | "large";

export const SPEED_FALLBACK: Record<Unit, number> = { rad: 1, m: 0.05 }; // full speed without a limit
export const STEPS: Record<Unit, Record<Exclude<StepSize, "hold">, number>> = {
  rad: { small: Math.PI / 1800, medium: Math.PI / 180, large: Math.PI / 18 },
  m: { small: 1e-4, medium: 1e-3, large: 1e-2 },
};

export interface Answer {
  status: string;
  text: string;
}

export class Jogging {
  readonly speed = signal(10); // percent of the velocity limit
  readonly step = signal<StepSize>("hold");
  readonly held = signal<{ axis: number; sign: 1 | -1 } | null>(null);
  readonly enabling = signal(false); // the enabling touch
  readonly answers = signal<ReadonlyMap<number, Answer>>(new Map());
  releases = 0; // counts causes of a release; a control that presses later compares it
  private readonly deadman: Deadman;
  private readonly connection: Connection;

  constructor(connection: Connection) {
    this.connection = connection;
    this.deadman = new Deadman(connection, () => performance.now());
  }

  /** Begin to serve tokens and to watch for causes of a release. Return a function that ends both. */
  attach(): () => void {
    const cancel = () => this.enable(false);
    const onVisibility = () => document.hidden && cancel();
    window.addEventListener("blur", cancel);
    window.addEventListener("pagehide", cancel);
    document.addEventListener("freeze", cancel);
    document.addEventListener("visibilitychange", onVisibility);
    const ends = [
      this.connection.on("token", ({ token }) => this.receiveToken(token)),
      this.connection.on("jog", (message) => this.receiveAnswer(message)),
      this.connection.on("hello", () => this.disconnect()),
      this.connection.on("gone", () => this.disconnect()),
      this.connection.stops.subscribe(cancel),
      asking.subscribe((open) => open && cancel()),
      this.connection.state.subscribe((state) => state !== "open" && this.disconnect()),
    ];
    return () => {
      this.release();
      this.disconnect(); // a press after this would have no heartbeats
      window.removeEventListener("blur", cancel);
      window.removeEventListener("pagehide", cancel);
      document.removeEventListener("freeze", cancel);
      document.removeEventListener("visibilitychange", onVisibility);
      for (const end of ends) end();
    };
  }

  /** Begin a jog of an axis while a control is held. */
  press(axis: number, sign: 1 | -1, jog: JogRequest, touch: boolean): void {
    const refusal = this.deadman.press(axis, jog, { touch });
    if (refusal === "busy") return;
    batch(() => {
      this.held.value = refusal === null ? { axis, sign } : null;
      if (refusal === null) this.forget(axis);
      else this.answer(axis, { status: "REFUSED", text: text.jog.refusals[refusal] });
    });
  }

  release(): void {
    this.releases += 1;
    this.deadman.release();
    this.held.value = null;
  }

  /** Set the enabling touch. Its end releases the jog. */
  enable(on: boolean): void {
    this.enabling.value = on;
    this.deadman.enable(on);
    if (!on) this.release();
  }

  /** Return the jog that the controls of the page describe. */
  request(info: AxisInfo | undefined, unit: Unit, sign: 1 | -1): JogRequest {
    const step = this.step.value;
    return {
      velocity: sign * speedOf(info, unit, this.speed.value),
      distance: step === "hold" ? null : STEPS[unit][step],
      acceleration: null,
    };
  }

  /** Remove the answer of an axis. */
  forget(axis: number): void {
    const answers = new Map(this.answers.value);
    answers.delete(axis);
    this.answers.value = answers;
  }

  private receiveToken(token: string): void {
    this.deadman.receiveToken(token);
    this.follow();
  }

  private receiveAnswer({ axis, press, status, text }: JogMessage): void {
    this.answer(axis, { status, text });
    this.deadman.receiveStatus(press, status);
    this.follow();
  }

  private disconnect(): void {
    this.deadman.disconnect();
    this.enabling.value = false;
    this.release();
  }

  /** Show that the jog ended, if it did. */
  private follow(): void {
    if (this.deadman.held === null) this.held.value = null;
  }

  private answer(axis: number, answer: Answer): void {
    this.answers.value = new Map(this.answers.value).set(axis, answer);
  }
}

/** Return the speed of a jog [rad/s or m/s]. */
export function speedOf(info: AxisInfo | undefined, unit: Unit, percent: number): number {
  const limit = info?.velocity_limit;
  const full = limit != null && Number.isFinite(limit) && limit > 0 ? limit : SPEED_FALLBACK[unit];
  return (full * percent) / 100;
}
