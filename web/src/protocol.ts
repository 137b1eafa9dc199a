/** Types of all messages between the page and the server of the dashboard. */

export type Role = "viewer" | "operator";
export type Json = null | boolean | number | string | Json[] | { [key: string]: Json };

export interface Session {
  role: Role;
  share: string;
  reason_no_jog: string | null;
}

export interface ErrorReply {
  kind: string;
  message: string;
  hint: string | null;
}

export interface Field {
  name: string;
  unit: string;
  shape: number[];
  per_axis: boolean;
}

export interface Layout {
  fields: Field[];
  axes: string[];
  period: number;
  clock: "monotonic" | "virtual";
  utc_offset_ns: number;
}

export interface HelloMessage {
  op: "hello";
  share: string;
  layout: Layout;
  run: string;
}

export interface GoneMessage {
  op: "gone";
  reason: string;
}

export interface TokenMessage {
  op: "token";
  token: string;
}

export interface AxisStatus {
  name: string;
  state: string;
  enabled: boolean;
  jogged: boolean;
  fault: string | null;
  stop_reason: string | null;
  position: number | null;
  velocity: number | null;
  torque: number | null;
  commanded_position: number | null;
}

export interface StatusMessage {
  op: "status";
  time: number;
  state: string;
  number: number;
  axes: AxisStatus[];
  lost_in_row: number;
}

export interface EventMessage {
  op: "event";
  serial: number;
  number: number;
  kind: string;
  message: string;
  time: number;
  position: number | null;
  details: { [key: string]: Json };
  advice?: string | null;
}

export interface Phase {
  median: number;
  p99: number;
  p999: number;
  max: number;
  count: number;
}

export interface TimingMessage {
  op: "timing";
  figures: { [phase: string]: Phase };
  counters: { [name: string]: number };
  histograms?: { [phase: string]: [number, number, number][] };
}

export interface JogMessage {
  op: "jog";
  axis: string;
  press: number;
  status: string;
  text: string;
}

export interface ErrorMessage {
  op: "error";
  about: string;
  message: string;
  hint: string | null;
}

export interface PongMessage {
  op: "pong";
  t: number;
}

export type ServerMessage =
  | HelloMessage
  | GoneMessage
  | TokenMessage
  | StatusMessage
  | EventMessage
  | TimingMessage
  | JogMessage
  | ErrorMessage
  | PongMessage;

export type RequestedState = "enable" | "disable" | "reset" | "quick_stop";

export type ClientMessage =
  | { op: "subscribe"; id: number; signals: string[]; full: boolean; rate: number }
  | { op: "unsubscribe"; id: number }
  | {
      op: "press";
      axis: string;
      velocity: number;
      distance: number | null;
      acceleration: number | null;
      token: string;
      press: number;
    }
  | { op: "beat"; axis: string; press: number; token: string }
  | { op: "release"; axis: string; press: number }
  | { op: "stop" }
  | { op: "request"; axes: string[]; state: RequestedState }
  | { op: "ping"; t: number };
