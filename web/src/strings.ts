/** All texts of the page. */

export const text = {
  navigation: {
    label: "Views",
    overview: "Overview",
    axes: "Axes",
    devices: "Devices",
  },
} as const;
