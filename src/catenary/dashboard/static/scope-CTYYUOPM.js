import{n as a,o as b,p as c}from"./chunk-OLRX34QB.js";import"./chunk-KOWXV3Q2.js";import"./chunk-BYXBJQAS.js";export{a as Scope,b as useFrames,c as useTheme};
