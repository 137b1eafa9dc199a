/**
 * Messages between the page and `catenary dashboard`: HTTP bodies, WebSocket JSON, binary frames.
 * The server side is src/catenary/dashboard/messages.py and frames.py. Units are SI.
 */

// HTTP

export type Role = "viewer" | "operator";

/** POST /login. 204: the cookie is set. 403: `{error}`. */
export interface LoginRequest {
  token: string;
}

/** GET /api/session. 401 without a cookie. */
export interface Session {
  role: Role;
  share: string;
  /** Why this session cannot jog; null if it can. */
  reason_no_jog: string | null;
  version: string;
}

export interface ErrorBody {
  kind: string;
  message: string;
  hint: string;
}

/** POST /api/call. */
export interface CallRequest {
  method: string;
  params: Record<string, unknown>;
}

/** Answer of POST /api/call and POST /api/doctor. `retry` [s]: the server is busy. */
export type CallAnswer<T> = { result: T } | { error: ErrorBody; retry?: number };

// WebSocket /ws: client to server

export interface Subscribe {
  op: "subscribe";
  /** 0 to 65535, chosen by the client; a second subscription with the same id replaces the first. */
  id: number;
  /** "number", "position[0]": names of fields, with an index for arrays. At most 256. */
  signals: string[];
  /** true: every cycle (kind 1). false: minimum and maximum of each frame (kind 2). */
  full: boolean;
  /** Frames per second, 1 to 60. */
  rate: number;
}

export interface Unsubscribe {
  op: "unsubscribe";
  id: number;
}

/** Sine of changing frequency; its amplitude is the velocity of the press. */
export interface Sweep {
  /** Frequency at the start, at least 0.001 [Hz]. */
  start: number;
  /** Frequency at the end, below half of the cycle rate [Hz]. */
  end: number;
  /** At least 0.2 [s]. */
  duration: number;
}

export interface Press {
  op: "press";
  /** Number of the axis in `layout.axes`. */
  axis: number;
  /** Signed velocity [rad/s or m/s]. */
  velocity: number;
  /** Length of a step [rad or m]; null: until the release. */
  distance: number | null;
  acceleration: number | null;
  /** null: constant velocity. A sweep needs distance null, and ends with status DONE. */
  sweep?: Sweep | null;
  /** Newest token that the server has sent. */
  token: string;
  /** Counter of the client; the answers and the beats repeat it. */
  press: number;
}

export interface Beat {
  op: "beat";
  axis: number;
  press: number;
  token: string;
}

export interface Release {
  op: "release";
  axis: number;
  press: number;
}

export interface Stop {
  op: "stop";
}

export type AxisRequest = "enable" | "disable" | "reset" | "quick_stop";

export interface StateRequest {
  op: "request";
  /** Numbers of axes; null: all. */
  axes: number[] | null;
  state: AxisRequest;
  /** Run of the loop whose axes the page shows (`hello.run`); another run refuses the request. */
  run?: string | null;
}

/** Request the poses of the 3D scene (kind 3), or end them. */
export interface PosesRequest {
  op: "poses";
  on: boolean;
}

export interface Ping {
  op: "ping";
  t: number;
}

export type ClientMessage =
  | Subscribe
  | Unsubscribe
  | Press
  | Beat
  | Release
  | Stop
  | StateRequest
  | PosesRequest
  | Ping;

// WebSocket /ws: server to client

export interface Field {
  name: string;
  unit: string;
  /** []: a number; [n]: an array. */
  shape: number[];
  /** True if the field has one number for each axis. */
  per_axis: boolean;
}

export interface Layout {
  fields: Field[];
  axes: string[];
  /** [s] */
  period: number;
  clock: "monotonic" | "virtual";
  utc_offset_ns: number;
}

/** Operating mode or preset that the program offers. */
export interface Choice {
  name: string;
  description: string;
}

/** The server has attached to a share. Subscriptions of an earlier run have ended. */
export interface Hello {
  op: "hello";
  share: string;
  layout: Layout;
  /** Identifier of this run of the loop. */
  run: string;
  role: Role;
  reason_no_jog: string | null;
  /** Process of the loop, as text. */
  program: string;
  /** True if the program answers requests (POST /api/call). */
  remote: boolean;
  modes: Choice[];
  presets: Choice[];
}

/** The share has ended, or does not exist yet. The server attaches again and sends `hello`. */
export interface Gone {
  op: "gone";
  reason: string;
}

/** To operators, every 50 ms. */
export interface Token {
  op: "token";
  token: string;
}

export interface AxisStatus {
  name: string;
  /** State of CiA 402, such as "OPERATION_ENABLED"; "" if unknown. */
  state: string;
  enabled: boolean;
  jogged: boolean;
  /** Error code of the drive with its meaning; "" if the axis is not in fault. */
  fault: string;
  /** Reason of the last stop by the core; "" if there is none. */
  stop_reason: string;
  /** null: not measured, or not finite. */
  position: number | null;
  velocity: number | null;
  torque: number | null;
  commanded_position: number | null;
}

/** At 20 Hz. */
export interface Status {
  op: "status";
  /** Start of the newest cycle on the clock of the loop [s]. */
  time: number;
  /** "running": cycles arrive. "stalled": no new cycle for `silent` seconds. */
  state: "running" | "stalled";
  /** Time since the last new cycle [s], on the clock of the server. */
  silent: number;
  /** Number of the newest cycle. */
  number: number;
  axes: AxisStatus[];
  /** Bad cycles in a row. */
  lost_in_row: number;
  /** Late wake-up of the newest cycle [s]. */
  lateness: number;
  /** Number of clients of this server. */
  clients: number;
  /** Operating mode; null: the program has set none. */
  mode: string | null;
}

export interface Event {
  op: "event";
  serial: number;
  number: number;
  kind: string;
  message: string;
  /** On the clock of the loop [s]. */
  time: number;
  /** Position of the device; null: the segment. */
  position: number | null;
  details: Record<string, unknown>;
  /** What to do; "" if unknown. */
  advice: string;
}

export interface Figures {
  median: number;
  p99: number;
  p999: number;
  max: number;
  count: number;
}

/** At 2 Hz: the result of the remote method `timing` with histograms. Seconds. */
export interface Timing {
  op: "timing";
  figures: Record<string, Figures>;
  counters: Record<string, number>;
  /** Per phase: [from, to, count]. */
  histograms: Record<string, [number, number, number][]>;
}

/** Change of the state of a jog, or a refused press. */
export interface JogMessage {
  op: "jog";
  axis: number;
  press: number;
  /** Name of a JogStatus: "MOVING", "DONE", "EXPIRED", "REFUSED_MODE" ... */
  status: string;
  text: string;
}

export interface ErrorMessage extends ErrorBody {
  op: "error";
  /** The `op` of the message that failed; "" if it was not understood. */
  about: string;
}

/** The server has written the stop word: the loop stops all axes in its next cycle. */
export interface Stopped {
  op: "stopped";
}

export interface Pong {
  op: "pong";
  t: number;
}

export type ServerMessage =
  | Hello
  | Gone
  | Token
  | Status
  | Event
  | Timing
  | JogMessage
  | ErrorMessage
  | Stopped
  | Pong;

// Binary frames, little endian. Header of 32 bytes:
// u8 kind, u8 version, u16 id, u32 rows, u32 signals, u32 lost rows before this frame,
// f64 first cycle number, f64 period [s].
// kind 1: f64 time[rows] [s], then per signal f64 value[rows].
// kind 2: f64 time[rows] (begin of the interval), then per signal f32 minimum[rows], f32 maximum[rows].
// kind 3: poses of the 3D scene (src/catenary/dashboard/scene.py).

export const FRAME_HEADER_BYTES = 32;
export const FRAME_VERSION = 1;
export const KIND_FULL = 1;
export const KIND_DECIMATED = 2;
export const KIND_POSES = 3;

/** WebSocket close codes of the server. */
export const CLOSE_POLICY = 1008; // no valid session, wrong origin, or too many messages
export const CLOSE_BUSY = 1013; // too many clients
