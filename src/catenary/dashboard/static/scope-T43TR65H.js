import{n as a,o as b,p as c}from"./chunk-3Y44RH6S.js";import"./chunk-LJGABZ57.js";import"./chunk-BYXBJQAS.js";export{a as Scope,b as useFrames,c as useTheme};
