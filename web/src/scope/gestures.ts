/** Pointer, wheel and keyboard on a chart: zoom, pan, cursors. */

import type { ChartsModel } from "./charts_model.ts";
import type { Span } from "./view.ts";

const NEAR = 9; // [px] around a cursor
const CLICK = 4; // [px]: a shorter drag selects nothing

type Action =
  | { kind: "cursor"; index: 0 | 1 }
  | { kind: "select"; start: number }
  | { kind: "pan"; last: number; moved: boolean }
  | { kind: "pinch"; distance: number };

/** Owns the gesture in progress on one chart. */
export class Gestures {
  private action: Action | null = null;
  private readonly pointers = new Map<number, number>();
  private readonly box = document.createElement("div");

  constructor(private readonly over: HTMLElement, private readonly model: ChartsModel) {
    this.box.className = "scope-selection";
    this.box.hidden = true;
    over.append(this.box);
    over.addEventListener("pointerdown", (event) => this.down(event));
    over.addEventListener("pointermove", (event) => this.move(event));
    for (const kind of ["pointerup", "pointercancel"] as const) {
      over.addEventListener(kind, (event) => this.up(event));
    }
    over.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    over.addEventListener("dblclick", () => this.model.live());
  }

  /** End the gesture in progress. */
  cancel(): void {
    this.action = null;
    this.pointers.clear();
    this.box.remove();
  }

  private down(event: PointerEvent): void {
    const x = this.position(event);
    this.over.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, x);
    const index = this.cursorNear(x);
    if (this.pointers.size === 2) this.action = { kind: "pinch", distance: this.distance() };
    else if (index !== null) this.action = { kind: "cursor", index };
    else if (event.pointerType === "mouse" && event.button === 0 && !event.shiftKey) {
      this.action = { kind: "select", start: x };
    } else this.action = { kind: "pan", last: x, moved: false };
  }

  private move(event: PointerEvent): void {
    if (!this.pointers.has(event.pointerId)) return;
    const x = this.position(event);
    this.pointers.set(event.pointerId, x);
    const { action } = this;
    if (action?.kind === "cursor") this.model.setCursor(action.index, this.time(x));
    else if (action?.kind === "select") this.drawBox(action.start, x);
    else if (action?.kind === "pan") this.pan(action, x);
    else if (action?.kind === "pinch") this.pinch(action);
  }

  private up(event: PointerEvent): void {
    const x = this.position(event);
    if (this.action?.kind === "select" && event.type === "pointerup") this.select(this.action.start, x);
    this.pointers.delete(event.pointerId);
    this.box.hidden = true;
    this.action = null;
  }

  private select(start: number, end: number): void {
    if (Math.abs(end - start) < CLICK) return;
    const [left, right] = start < end ? [start, end] : [end, start];
    this.model.show({ start: this.time(left), end: this.time(right) });
  }

  private pan(action: { last: number; moved: boolean }, x: number): void {
    if (!action.moved && Math.abs(x - action.last) < CLICK) return;
    action.moved = true;
    this.model.pan(this.time(action.last) - this.time(x));
    action.last = x;
  }

  private pinch(action: { distance: number }): void {
    const distance = this.distance();
    const [a = 0, b = 0] = this.pointers.values();
    if (distance < 10) return;
    this.model.zoom(action.distance / distance, this.time((a + b) / 2));
    action.distance = distance;
  }

  private wheel(event: WheelEvent): void {
    event.preventDefault();
    if (Math.abs(event.deltaY) >= Math.abs(event.deltaX)) {
      this.model.zoom(Math.exp(event.deltaY * 0.002), this.time(this.position(event)));
    } else this.model.pan(this.time(event.deltaX) - this.time(0));
  }

  private drawBox(start: number, end: number): void {
    this.box.hidden = false;
    this.box.style.left = `${Math.min(start, end)}px`;
    this.box.style.width = `${Math.abs(end - start)}px`;
  }

  private cursorNear(x: number): 0 | 1 | null {
    const [a, b] = this.model.cursors.peek().map((time) => (time === null ? Infinity : Math.abs(this.place(time) - x)));
    if (Math.min(a!, b!) > NEAR) return null;
    return a! <= b! ? 0 : 1;
  }

  private distance(): number {
    const [a = 0, b = 0] = this.pointers.values();
    return Math.abs(a - b);
  }

  private position(event: MouseEvent): number {
    return event.clientX - this.over.getBoundingClientRect().left;
  }

  private time(x: number): number {
    const { start, end }: Span = this.model.span;
    return start + (x / this.over.clientWidth) * (end - start);
  }

  private place(time: number): number {
    const { start, end } = this.model.span;
    return ((time - start) / (end - start)) * this.over.clientWidth;
  }
}

/** Handle a key on a focused chart. Return true if the key has a meaning here. */
export function chartKey(event: KeyboardEvent, model: ChartsModel): boolean {
  const { start, end } = model.span;
  const length = end - start;
  const cursor = event.altKey ? 1 : 0;
  const at = model.cursors.peek()[cursor];
  if (event.key === "ArrowLeft" || event.key === "ArrowRight") {
    const step = (event.key === "ArrowLeft" ? -1 : 1) * length;
    if (event.shiftKey && at !== null && at !== undefined) model.setCursor(cursor, at + step / 200);
    else model.pan(step / 10);
  } else if (event.key === "+") model.zoom(0.8, (start + end) / 2);
  else if (event.key === "-") model.zoom(1.25, (start + end) / 2);
  else if (event.key === "Home" || event.key === "0") model.live();
  else if (event.key === "p") model.pause();
  else return false;
  return true;
}
