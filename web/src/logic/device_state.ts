/** Colours of device states. */

import type { Device } from "../remote.ts";

export function stateTone(device: Pick<Device, "state" | "error" | "lost">): "ok" | "warn" | "bad" {
  if (device.error || device.lost || device.state === "") return "bad";
  return device.state === "OP" ? "ok" : "warn";
}

/** Return all errors that the ports of a device counted. */
export function portErrors(
  ports: readonly { rx_errors: number; lost_links: number }[],
): number {
  return ports.reduce((sum, port) => sum + port.rx_errors + port.lost_links, 0);
}
