/** Connection to the server of the dashboard. It reconnects by itself. */

import { computed, signal } from "@preact/signals";
import { decodeFrame, type Frame } from "./frame.ts";
import type {
  AxisRequest,
  CallAnswer,
  ClientMessage,
  ErrorBody,
  Event,
  Hello,
  ServerMessage,
  Session,
  Status,
  Sweep,
  Timing,
} from "./protocol.ts";
import { KIND_DECIMATED, KIND_FULL } from "./protocol.ts";

/** "login": the server requires a token. "gone": the server answers, the share has ended. */
export type LinkState = "connecting" | "open" | "gone" | "lost" | "login";
export type Kind = ServerMessage["op"];
export type MessageOf<K extends Kind> = Extract<ServerMessage, { op: K }>;

export interface SubscribeOptions {
  full: boolean; // every sample; otherwise minimum and maximum of intervals
  rate: number; // frames per second
}

export interface JogRequest {
  velocity: number; // signed [rad/s or m/s]
  distance: number | null; // [rad or m]; null: until release
  acceleration: number | null; // null: limit of the axis
  sweep?: Sweep | null; // sine of changing frequency, without a distance
}

interface Subscription extends SubscribeOptions {
  signals: string[];
  callback: (frame: Frame) => void;
}

export const BACKOFF_FIRST = 100; // [ms]
export const BACKOFF_LAST = 2000; // [ms]
export const EVENTS_KEPT = 500;
export const SILENCE = 3000; // [ms] without any message: the connection counts as lost
export const STATUS_SILENCE = 2000; // [ms] without a status: the shown values count as old
const PING_INTERVAL = 1000; // [ms]
const SESSION_INTERVAL = 3_600_000; // [ms] between two renewals of the cookie

/** Error that the server or the loop reported. */
export class RemoteError extends Error {
  readonly kind: string;
  readonly hint: string;

  constructor(reply: ErrorBody) {
    super(reply.message);
    this.kind = reply.kind;
    this.hint = reply.hint;
  }
}

export class Connection {
  readonly state = signal<LinkState>("connecting");
  readonly reason = signal<string | null>(null); // why the share is gone
  readonly session = signal<Session | null>(null);
  readonly hello = signal<Hello | null>(null);
  readonly status = signal<Status | null>(null);
  readonly timing = signal<Timing | null>(null);
  readonly events = signal<readonly Event[]>([]); // newest first
  readonly role = computed(() => this.hello.value?.role ?? this.session.value?.role ?? null);
  readonly fresh = signal(true); // false: no status for STATUS_SILENCE
  readonly running = computed(() => this.status.value?.state !== "stalled");
  /** Operating mode; null: the program has set none, or the page does not know it now. */
  readonly mode = computed(() =>
    this.state.value === "open" && this.fresh.value ? (this.status.value?.mode ?? null) : null,
  );
  readonly losing = computed(() => (this.status.value?.lost_in_row ?? 0) > 0);
  readonly delay = signal<number | null>(null); // round trip to the server [ms]

  readonly stops = signal(0); // number of quick stops that this page requested

  private socket: WebSocket | null = null;
  private backoff = BACKOFF_FIRST;
  private nextId = 1;
  private nextPress = 1;
  private received = 0;
  private statusTime = 0;
  private readonly subscriptions = new Map<number, Subscription>();
  private readonly callbacks = new Map<Kind, Set<(message: never) => void>>();
  private readonly binary = new Map<number, Set<(buffer: ArrayBuffer) => void>>();

  /** Exchange the token of the URL fragment for a cookie, then connect. */
  async start(): Promise<void> {
    setInterval(() => void fetch("/api/session").catch(() => undefined), SESSION_INTERVAL);
    const token = new URLSearchParams(location.hash.slice(1)).get("token");
    if (token !== null) {
      history.replaceState(null, "", location.pathname + location.search);
      await this.login(token);
      return;
    }
    await this.connect();
  }

  /** Return true if the server accepted the token. */
  async login(token: string): Promise<boolean> {
    try {
      const reply = await post("/login", { token }, AbortSignal.timeout(SILENCE));
      if (!reply.ok) {
        this.state.value = "login";
        return false;
      }
    } catch {
      this.retry();
      return true;
    }
    await this.connect();
    return true;
  }

  /** Register a callback for messages of one kind, and return a function that removes it. */
  on<K extends Kind>(kind: K, callback: (message: MessageOf<K>) => void): () => void {
    return added(this.callbacks, kind, callback as (message: never) => void);
  }

  /** Register a callback for binary frames whose first byte is `kind`. */
  onBinary(kind: number, callback: (buffer: ArrayBuffer) => void): () => void {
    return added(this.binary, kind, callback);
  }

  /** Call a method of the loop's process. Throws RemoteError. */
  async call<T>(method: string, params: object = {}): Promise<T> {
    return this.post<T>("/api/call", { method, params });
  }

  /** Post JSON, and return the result. Throws RemoteError. */
  async post<T>(path: string, body: object = {}): Promise<T> {
    const reply = await post(path, body);
    if (reply.status === 401 && this.socket === null) this.state.value = "login"; // the stop stays
    const answer = (await reply.json()) as CallAnswer<T>;
    if ("error" in answer) throw new RemoteError(answer.error);
    return answer.result;
  }

  /** Subscribe to signals such as "position[0]", and return a function that ends the subscription. */
  subscribe(
    signals: string[],
    options: SubscribeOptions,
    callback: (frame: Frame) => void,
  ): () => void {
    const id = this.nextId;
    this.nextId = (this.nextId % 0x7fff) + 1;
    this.subscriptions.set(id, { signals, ...options, callback });
    if (this.state.value === "open") this.announce(id);
    return () => {
      this.subscriptions.delete(id);
      this.send({ op: "unsubscribe", id });
    };
  }

  /** Request a jog. Return its press number, or null if there is no connection. */
  press(axis: number, jog: JogRequest, token: string): number | null {
    const press = this.nextPress++;
    return this.send({ op: "press", axis, ...jog, token, press }) ? press : null;
  }

  /** Echo a token of the loop: the jog continues until 200 ms after its issue. */
  beat(axis: number, press: number, token: string): void {
    this.send({ op: "beat", axis, press, token });
  }

  release(axis: number, press: number): void {
    this.send({ op: "release", axis, press });
  }

  /** Request a quick stop of all axes. Return false if there is no connection. */
  stop(): boolean {
    const sent = this.send({ op: "stop" });
    this.stops.value += 1;
    return sent;
  }

  request(axes: number[] | null, state: AxisRequest): void {
    this.send({ op: "request", axes, state, run: this.hello.value?.run ?? null });
  }

  send(message: ClientMessage): boolean {
    if (this.socket?.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }

  private async connect(): Promise<void> {
    let session: Session;
    try {
      const reply = await fetch("/api/session", { signal: AbortSignal.timeout(SILENCE) });
      if (reply.status === 401 || reply.status === 403) {
        this.state.value = "login";
        return;
      }
      if (!reply.ok) throw new Error(reply.statusText);
      session = (await reply.json()) as Session;
    } catch {
      this.retry();
      return;
    }
    this.session.value = session;
    this.open();
  }

  private open(): void {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/ws`);
    const former = this.socket;
    this.socket = socket;
    former?.close();
    this.received = performance.now();
    socket.binaryType = "arraybuffer";
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
      this.received = performance.now();
      if (typeof event.data === "string") this.receive(JSON.parse(event.data) as ServerMessage);
      else this.receiveBinary(event.data);
    };
    const watch = setInterval(() => this.watch(socket), PING_INTERVAL);
    socket.onclose = () => {
      clearInterval(watch);
      if (this.socket !== socket) return;
      this.socket = null;
      this.retry();
    };
  }

  private watch(socket: WebSocket): void {
    if (performance.now() - this.received > SILENCE) {
      socket.onclose?.(new CloseEvent("close"));
      socket.close();
      return;
    }
    const status = this.status.value;
    this.fresh.value = status === null || performance.now() - this.statusTime < STATUS_SILENCE;
    this.send({ op: "ping", t: performance.now() });
  }

  private retry(): void {
    this.state.value = "lost";
    this.delay.value = null;
    setTimeout(() => void this.connect(), this.backoff);
    this.backoff = Math.min(2 * this.backoff, BACKOFF_LAST);
  }

  private receive(message: ServerMessage): void {
    if (message.op === "hello") this.receiveHello(message);
    else if (message.op === "gone") this.receiveGone(message.reason);
    else if (message.op === "status") this.receiveStatus(message);
    else if (message.op === "timing") this.timing.value = message;
    else if (message.op === "event") this.receiveEvent(message);
    else if (message.op === "pong") this.delay.value = performance.now() - message.t;
    for (const callback of this.callbacks.get(message.op) ?? []) callback(message as never);
  }

  private receiveHello(message: Hello): void {
    if (this.hello.value?.run !== message.run) {
      this.events.value = [];
      this.timing.value = null;
    }
    this.status.value = null; // that of the former connection is old
    this.backoff = BACKOFF_FIRST;
    this.statusTime = performance.now();
    this.fresh.value = true;
    this.hello.value = message;
    this.reason.value = null;
    this.state.value = "open";
    for (const id of this.subscriptions.keys()) this.announce(id);
  }

  private receiveStatus(status: Status): void {
    this.statusTime = performance.now();
    this.fresh.value = true;
    this.status.value = status;
  }

  private receiveGone(reason: string): void {
    this.reason.value = reason;
    this.state.value = "gone";
  }

  private receiveEvent(event: Event): void {
    if (this.events.value.some((known) => known.serial === event.serial)) return;
    this.events.value = [event, ...this.events.value].slice(0, EVENTS_KEPT);
  }

  private receiveBinary(buffer: ArrayBuffer): void {
    const kind = new Uint8Array(buffer)[0] ?? 0;
    for (const callback of this.binary.get(kind) ?? []) callback(buffer);
    if (kind !== KIND_FULL && kind !== KIND_DECIMATED) return;
    const frame = decodeFrame(buffer);
    this.subscriptions.get(frame.id)?.callback(frame);
  }

  private announce(id: number): void {
    const subscription = this.subscriptions.get(id);
    if (subscription === undefined) return;
    const { signals, full, rate } = subscription;
    this.send({ op: "subscribe", id, signals, full, rate });
  }
}

function post(path: string, body: object, signal?: AbortSignal): Promise<Response> {
  return fetch(path, {
    signal: signal ?? null,
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(body),
  });
}

function added<K, V>(registry: Map<K, Set<V>>, key: K, callback: V): () => void {
  const callbacks = registry.get(key) ?? new Set<V>();
  registry.set(key, callbacks);
  callbacks.add(callback);
  return () => callbacks.delete(callback);
}
