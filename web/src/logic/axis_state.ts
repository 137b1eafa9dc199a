/** States of axes. */

import type { AxisStatus } from "../protocol.ts";

/**
 * Return true if the drive powers the axis. `enabled` is false while an axis does not follow the
 * targets of the application, as during a jog.
 */
export function isPowered(axis: Pick<AxisStatus, "state" | "enabled" | "jogged">): boolean {
  return axis.enabled || axis.jogged || axis.state === "OPERATION_ENABLED";
}
