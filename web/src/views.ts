/** Views of the page, in the order of the navigation. */

import type { ComponentType } from "preact";
import type { Connection } from "./connection.ts";
import { lazy } from "./parts/lazy.tsx";
import { text } from "./strings.ts";
import { Axes } from "./views/axes.tsx";
import { Devices } from "./views/devices.tsx";
import { Overview } from "./views/overview.tsx";

export interface View {
  key: string; // in the URL fragment: #/overview
  label: string;
  icon: string; // path of an SVG of 24 x 24
  component: ComponentType<{ connection: Connection }>;
}

const Scope = lazy(() => import("./scope/scope.tsx").then((module) => module.Scope));
const Tune = lazy(() => import("./tune/tune.tsx").then((module) => module.Tune));
const Recordings = lazy(() =>
  import("./recordings/recordings.tsx").then((module) => module.Recordings),
);

export const views: View[] = [
  {
    key: "overview",
    label: text.navigation.overview,
    icon: "M3 12h4l3-8 4 16 3-8h4",
    component: Overview,
  },
  {
    key: "axes",
    label: text.navigation.axes,
    icon: "M4 7h16M4 17h16M9 4v6M15 14v6",
    component: Axes,
  },
  {
    key: "devices",
    label: text.navigation.devices,
    icon: "M9 3h6v5H9zM3 16h6v5H3zM15 16h6v5h-6zM12 8v4M6 16v-4h12v4",
    component: Devices,
  },
  {
    key: "scope",
    label: text.navigation.scope,
    icon: "M3 4h18v16H3zM6 14c2-8 4-8 6-2s4 6 6-2",
    component: Scope,
  },
  {
    key: "tune",
    label: text.navigation.tune,
    icon: "M6 3v10M6 17v4M12 3v4M12 11v10M18 3v12M18 19v2M3.500 15h5M9.500 9h5M15.500 17h5",
    component: Tune,
  },
  {
    key: "recordings",
    label: text.navigation.recordings,
    icon: "M4 5h16v14H4zM9 5v14M15 5v14M4 10h5M4 14h5M15 10h5M15 14h5",
    component: Recordings,
  },
];
