import{n as a,o as b,p as c}from"./chunk-PXZ4A3ZK.js";import"./chunk-C76P57AF.js";import"./chunk-BYXBJQAS.js";export{a as Scope,b as useFrames,c as useTheme};
