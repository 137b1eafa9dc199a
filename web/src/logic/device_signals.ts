/** Fields of a share that belong to a device. */

import type { Layout } from "../protocol.ts";

export interface DeviceSignal {
  signal: string; // as in a subscription: "position[0]"
  label: string;
  unit: string;
}

/** Return the values of the axes of a device, and the fields with its position in their name. */
export function signalsOf(layout: Layout, device: { position: number; axes: string[] }): DeviceSignal[] {
  const axes = device.axes.map((name) => layout.axes.indexOf(name)).filter((axis) => axis >= 0);
  const suffix = ` of device ${device.position}`;
  return layout.fields.flatMap(({ name, unit, shape, per_axis }) => {
    if (per_axis) {
      return axes.map((axis) => ({
        signal: `${name}[${axis}]`,
        label: axes.length > 1 ? `${name} · ${layout.axes[axis]}` : name,
        unit,
      }));
    }
    if (!name.endsWith(suffix)) return [];
    const count = shape[0];
    const label = name.slice(0, -suffix.length);
    if (count === undefined) return [{ signal: name, label, unit }];
    return Array.from({ length: count }, (_, at) => ({
      signal: `${name}[${at}]`,
      label: `${label}[${at}]`,
      unit,
    }));
  });
}
