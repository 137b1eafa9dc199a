/** Results of the remote methods, as `catenary.remote.messages` defines them. */

export type DeviceState = "INIT" | "PRE-OP" | "SAFE-OP" | "OP" | "BOOT" | "";

export interface Greeting {
  version: string;
  pid: number;
  program: string;
  share: string;
  period: number; // [s]
  networks: number;
  jog: boolean;
  virtual: boolean; // true: cables and power of the segment can be changed
  started: number; // UTC [s]
}

export interface Port {
  port: number;
  link: boolean;
  loop_closed: boolean;
  rx_errors: number;
  forwarded_errors: number;
  lost_links: number;
}

export interface Device {
  position: number;
  network: number;
  name: string;
  group: string;
  vendor: number;
  product: number;
  revision: number;
  serial: number;
  alias: number;
  state: DeviceState; // "": it does not answer
  error: boolean;
  al_status_code: number;
  al_status_text: string;
  parent: number | null;
  parent_port: number | null;
  ports: Port[];
  delay_ns: number | null;
  coe: boolean;
  axes: string[];
  optional: boolean;
  lost: boolean;
}

export interface AxisInfo {
  name: string;
  network: number;
  device: number;
  unit: "rad" | "m";
  mode: number; // 0x6060
  position_min: number | null; // null: none
  position_max: number | null;
  velocity_limit: number | null;
  torque_limit: number | null;
  acceleration: number | null;
  deceleration: number | null;
}

export interface ObjectEntry {
  index: number;
  subindex: number;
  object_name: string;
  name: string;
  type: string;
  bits: number;
  access: string; // "r", "w" or "rw", perhaps with states
  unit: string;
  options: { [value: string]: string };
  minimum: number | null;
  maximum: number | null;
}

export interface ObjectPage {
  entries: ObjectEntry[];
  next: number | null; // `after` of the next page
  notes: string[];
}

export interface ObjectValue {
  data: string; // base64
  value: number | boolean | string | null;
  type: string;
  text: string;
}

export interface Problem {
  what: string;
  where: string;
  advice: string;
}

export interface Diagnosis {
  problems: Problem[];
  text: string;
}

/** Result of `catenary doctor`. */
export interface Check {
  id: string;
  status: "PASS" | "WARN" | "FAIL" | "SKIP";
  found: string;
  advice: string;
}

export interface Examination {
  checks: Check[];
}

export interface Emergency {
  error_code: number;
  error_register: number;
  text: string;
}

export interface Clock {
  position: number;
  name: string;
  reference: boolean;
  difference: number | null; // [s]
}

export interface Clocks {
  clocks: Clock[];
  locked: boolean;
  text: string;
}

/** Completion of a request. `note` describes a side effect. */
export interface Done {
  note: string;
}
